//! Files and standard output, whole or not at all; numbers as people read them.

use crate::error::{Error, Result};
use std::io::Write;
use std::path::Path;

/// Writes a regular file so that at any moment either the old or the complete new one is there.
///
/// # Errors
/// [`Error::Write`]; the old file then stands.
pub fn write_file(path: &Path, content: &[u8]) -> Result<()> {
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
    let mut builder = tempfile::Builder::new();
    // What a plainly created file would get before the umask, not a temporary file's owner-only.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(directory).map_err(&error)?;
    file.write_all(content).map_err(&error)?;
    file.as_file().sync_all().map_err(&error)?;
    file.persist(path).map_err(|e| error(e.error))?;
    Ok(())
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
