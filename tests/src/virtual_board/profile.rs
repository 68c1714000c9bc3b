//! What each part of the control interrupt costs: every instruction that it executes is counted where it lies, and
//! belongs to the part of the program that its line is in.
//!
//! Everything is inlined into everything in a release; the debug information of the ELF says what was inlined where. An
//! instruction belongs to the innermost of its frames that is a part of the control: what `nalgebra` does for the
//! observer is the observer's, and so are the filters.

use addr2line::Loader;
use std::collections::BTreeMap;
use std::path::Path;

/// Instructions and estimated cycles, by halfword of flash.
#[derive(Clone, Debug, Default)]
pub struct Counts(Vec<(u64, u64)>);

impl Counts {
    /// An instruction at a halfword of flash has been executed.
    pub fn add(&mut self, halfword: usize, cycles: u64) {
        if self.0.len() <= halfword {
            self.0.resize(halfword + 1, (0, 0));
        }
        let (instructions, sum) = &mut self.0[halfword];
        *instructions += 1;
        *sum += cycles;
    }
}

/// What a part has cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Instructions.
    pub instructions: u64,
    /// Estimated cycles.
    pub cycles: u64,
}

/// Parts that work for others.
const HELPERS: [&str; 3] = ["filter", "units", "lib"];

/// By part of the program, `core` and `firmware` alike, the most expensive first. Entry and exit of the interrupt are not
/// in it: they are no instructions.
///
/// * `elf`: whose debug information says so
///
/// # Errors
/// One sentence where it has none.
pub fn by_part(counts: &Counts, elf: &Path) -> Result<Vec<(String, Cost)>, String> {
    let failed = |error| format!("{}: no debug information: {error}", elf.display());
    let loader = Loader::new(elf).map_err(failed)?;
    let mut parts: BTreeMap<String, Cost> = BTreeMap::new();
    let executed = counts.0.iter().enumerate();
    for (halfword, (instructions, cycles)) in executed.filter(|(_, count)| count.0 > 0) {
        let address = u64::from(super::image::FLASH) + 2 * halfword as u64;
        let mut frames = loader.find_frames(address).map_err(failed)?;
        let (mut part, mut helper) = (None, None);
        while let (None, Some(frame)) = (&part, frames.next().map_err(|e| failed(e.into()))?) {
            let file = frame.location.and_then(|location| location.file);
            match file.and_then(part_of) {
                Some(name) if HELPERS.contains(&name) => helper = Some(name.to_owned()),
                name => part = name.map(str::to_owned),
            }
        }
        let name = part.or(helper).unwrap_or_else(|| "elsewhere".into());
        let cost = parts.entry(name).or_default();
        cost.instructions += instructions;
        cost.cycles += cycles;
    }
    let mut parts: Vec<(String, Cost)> = parts.into_iter().collect();
    parts.sort_by_key(|(_, cost)| std::cmp::Reverse(cost.cycles));
    Ok(parts)
}

/// The part that a source file is of: a module of the core, or the firmware.
fn part_of(file: &str) -> Option<&str> {
    if file.contains("firmware/src/") {
        return Some("firmware");
    }
    let (before, within) = file.split_once("core/src/")?;
    // The library of the language is called the same.
    if before.contains("library/") {
        return None;
    }
    let end = within.find(['/', '.'])?;
    within.get(..end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_of_parts() {
        for (file, part) in [
            ("core/src/observer/anchored.rs", Some("observer")),
            ("/home/drive/core/src/encoder.rs", Some("encoder")),
            ("firmware/src/board/stm32f405/encoder.rs", Some("firmware")),
            ("/usr/lib/rustlib/src/rust/library/core/src/cmp.rs", None),
            ("nalgebra-0.35.0/src/base/blas.rs", None),
        ] {
            assert_eq!(part_of(file), part, "{file}");
        }
    }

    #[test]
    fn instructions_add_up() {
        let mut counts = Counts::default();
        for (halfword, cycles) in [(3, 1), (3, 2), (9, 4)] {
            counts.add(halfword, cycles);
        }
        assert_eq!(counts.0[3], (2, 3));
        assert_eq!(counts.0[9], (1, 4));
        assert_eq!(counts.0.iter().map(|count| count.0).sum::<u64>(), 3);
    }
}
