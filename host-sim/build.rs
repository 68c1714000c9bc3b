//! A digest of what the figures of a run follow from, by which one build of a version is told from another: the sources
//! of this program and of the core, and the versions of what they use.

use sha2::{Digest, Sha256};
use std::io::Result;
use std::path::{Path, PathBuf};

fn main() -> Result<()> {
    let mut files = Vec::new();
    for place in ["src", "drive.toml", "../core/src", "../Cargo.lock"] {
        println!("cargo::rerun-if-changed={place}");
        collect(Path::new(place), &mut files)?;
    }
    // Paths have one order on all systems.
    files.sort();
    let mut hash = Sha256::new();
    for file in files {
        let content = std::fs::read(file)?;
        hash.update((content.len() as u64).to_le_bytes());
        hash.update(content);
    }
    let digits = hash
        .finalize()
        .into_iter()
        .map(|byte| format!("{byte:02x}"));
    println!(
        "cargo::rustc-env=HOST_SIM_SOURCES={}",
        digits.collect::<String>()
    );
    Ok(())
}

/// All files in a place.
fn collect(place: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    if place.is_file() {
        files.push(place.to_owned());
        return Ok(());
    }
    for entry in std::fs::read_dir(place)? {
        collect(&entry?.path(), files)?;
    }
    Ok(())
}
