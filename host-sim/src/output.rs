//! Files and standard output, whole or not at all; numbers as people read them; how far a long task is.

use crate::error::{Error, Result};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Called by what takes long: steps done, steps in all, and what comes next.
pub type Progress<'a> = dyn Fn(usize, usize, &str) + 'a;

/// Nobody wants to know.
pub fn unwatched(_: usize, _: usize, _: &str) {}

/// How the temporary files of [`write_file`] begin and end.
const TEMPORARY: (&str, &str) = (".host-sim-", ".tmp");
/// A run locks its unfinished file within this after it has created it.
const LOCKED: Duration = Duration::from_secs(1);

/// Removes what runs that were killed have left unfinished in a folder: nobody has these files locked.
fn clean_up(directory: &Path) {
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
    for entry in entries {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let ours = name.starts_with(TEMPORARY.0) && name.ends_with(TEMPORARY.1);
        let abandoned = || {
            let metadata = entry.metadata().ok()?;
            let age = metadata.modified().ok()?.elapsed().ok()?;
            let old = metadata.is_file() && age > LOCKED;
            let file = old.then(|| std::fs::File::open(entry.path()).ok())??;
            file.try_lock().ok()
        };
        if ours && abandoned().is_some() {
            // What cannot be removed does no harm.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Writes a regular file so that at any moment either the old or the complete new one is there.
///
/// # Errors
/// [`Error::Write`]; the old file then stands.
pub fn write_file(path: &Path, content: &[u8]) -> Result<()> {
    let mut file = Unfinished::create(path)?;
    file.write_all(content).map_err(Error::write(path))?;
    file.finish()
}

/// A regular file that is there once it is finished; until then the old one stands.
#[derive(Debug)]
pub struct Unfinished {
    file: tempfile::NamedTempFile,
    path: PathBuf,
}

impl Unfinished {
    /// Begins a file in the folder of `path`.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn create(path: &Path) -> Result<Self> {
        let error = Error::write(path);
        // A device or a pipe would be replaced by a file.
        if path.metadata().is_ok_and(|found| !found.is_file()) {
            return Err(error(std::io::Error::other("is there and is no file")));
        }
        let directory = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        std::fs::create_dir_all(directory).map_err(&error)?;
        clean_up(directory);
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMPORARY.0).suffix(TEMPORARY.1);
        // What a plainly created file would get before the umask, not a temporary file's owner-only.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(directory).map_err(&error)?;
        // Where files cannot be locked, none is taken for abandoned either.
        let _ = file.as_file().try_lock();
        let path = path.to_owned();
        Ok(Self { file, path })
    }

    /// Puts it in the place of the old one.
    ///
    /// # Errors
    /// [`Error::Write`]; the old file then stands.
    pub fn finish(self) -> Result<()> {
        let error = Error::write(&self.path);
        self.file.as_file().sync_all().map_err(&error)?;
        self.file.persist(&self.path).map_err(|e| error(e.error))?;
        Ok(())
    }
}

impl Read for Unfinished {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.file.read(bytes)
    }
}

impl Write for Unfinished {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Unfinished {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.file.seek(to)
    }
}

/// Prints text; a reader that has gone away (`| head`) is no error.
///
/// # Errors
/// [`Error::Write`] when standard output cannot take the text.
pub fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::Write {
            path: "standard output".into(),
            source,
        }),
        _ => Ok(()),
    }
}

/// A number for people, with so many significant figures, whatever its size.
#[must_use]
pub fn significant(value: f64, figures: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value:.*}", figures - 1);
    }
    let decimals = figures as i32 - 1 - value.abs().log10().floor() as i32;
    if (0..=figures as i32 + 3).contains(&decimals) {
        format!("{value:.*}", decimals as usize)
    } else {
        format!("{value:.*e}", figures - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unfinished files of runs that were killed go, those of runs that go on stay, however long they take, and
    /// so does what somebody else calls nearly the same.
    #[test]
    fn abandoned_files_are_removed() {
        let directory = tempfile::tempdir().unwrap();
        let old = std::time::SystemTime::now() - 2 * LOCKED;
        let make = |name: &str, age: Option<std::time::SystemTime>| {
            let file = std::fs::File::create(directory.path().join(name)).unwrap();
            if let Some(time) = age {
                file.set_modified(time).unwrap();
            }
            file
        };
        make(".host-sim-abandoned.tmp", Some(old));
        let at_work = make(".host-sim-at-work.tmp", Some(old));
        at_work.lock().unwrap();
        make(".host-sim-new.tmp", None);
        make(".host-simulation.txt", Some(old));
        make("host-sim-old.tmp", Some(old));
        write_file(&directory.path().join("new.txt"), b"new").unwrap();
        let names = std::fs::read_dir(directory.path()).unwrap();
        let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        assert_eq!(
            names,
            [
                ".host-sim-at-work.tmp",
                ".host-sim-new.tmp",
                ".host-simulation.txt",
                "host-sim-old.tmp",
                "new.txt"
            ]
        );
    }

    #[test]
    fn numbers_keep_their_figures() {
        for (value, expected) in [
            (0.5, "0.500"),
            (-0.000_512_34, "-0.000512"),
            (29.5, "29.5"),
            (300.0, "300"),
            (1234.0, "1.23e3"),
            (3e-7, "3.00e-7"),
            (0.0, "0.00"),
        ] {
            assert_eq!(significant(value, 3), expected);
        }
        assert_eq!(significant(f64::NAN, 3), "NaN");
    }
}
