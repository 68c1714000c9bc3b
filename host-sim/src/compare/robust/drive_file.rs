//! The drive file with a tuned gain, observer and plan in it: everything else, comments included, stays as it was.
//!
//! `[gain]` stands where `[cost]` stood, which it replaces.

use crate::drive::edit::set;
use crate::drive::{Drive, Weights};
use crate::error::{Error, Result};
use toml_edit::{Array, DocumentMut, Item, Table};

/// The text of a drive file with what was found for it.
///
/// * `text`: the file that was tuned
/// * `tuned`: what was found
///
/// # Errors
/// [`Error::Comparison`] when the text is no drive file.
pub fn drive_file(text: &str, tuned: &Drive) -> Result<String> {
    let mut document: DocumentMut = text.parse().map_err(|error| {
        Error::Comparison(format!("the drive file cannot be rewritten: {error}"))
    })?;
    if let Weights::Gain { position, velocity } = &tuned.cost.weights {
        let place = document
            .get("cost")
            .and_then(Item::as_table)
            .and_then(Table::position);
        document.remove("cost");
        let gain = table(&mut document, "gain");
        if let (Some(place), Some(table)) = (place, gain.as_table_mut()) {
            table.set_position(Some(place));
        }
        set(
            gain,
            "position",
            position.iter().copied().collect::<Array>(),
        );
        set(
            gain,
            "velocity",
            velocity.iter().copied().collect::<Array>(),
        );
    }
    let observer = table(&mut document, "observer");
    if observer.get("design").is_some() {
        set(observer, "design", "kalman");
    }
    set(
        observer,
        "load_force_ratio",
        tuned.observer.load_force_ratio,
    );
    set(
        observer,
        "disturbance_rate",
        tuned.observer.disturbance_rate,
    );
    if let Some(share) = tuned.motion.current_share {
        set(table(&mut document, "move"), "current_share", share);
    }
    Ok(document.to_string())
}

/// A table of the file; one that is not there yet is added.
fn table<'d>(document: &'d mut DocumentMut, name: &str) -> &'d mut Item {
    document.entry(name).or_insert(Item::Table(Table::new()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::DEFAULT_DRIVE;

    /// What was tuned is in the file, to the last figure, and what was not, comments included, stays.
    #[test]
    fn the_gain_takes_the_place_of_the_cost() {
        let mut tuned = Drive::default_drive();
        tuned.cost.weights = Weights::Gain {
            position: vec![15.3, -5.0, -0.54, 8.7],
            velocity: vec![0.41, 0.2, -0.16, -0.1],
        };
        tuned.observer.load_force_ratio = 12.5;
        tuned.observer.disturbance_rate = 220.0;
        tuned.motion.current_share = Some(0.3069);
        let text = drive_file(DEFAULT_DRIVE, &tuned).unwrap();
        let read = Drive::parse(&text, "tuned").unwrap();
        assert_eq!(read.cost.weights, tuned.cost.weights);
        assert_eq!(read.observer, tuned.observer);
        assert_eq!(read.motion, tuned.motion);
        assert_eq!(
            (&read.actuator, &read.loads),
            (&tuned.actuator, &tuned.loads)
        );
        assert!(
            text.contains("velocity = 2.0          # m/s, of the actuator"),
            "{text}"
        );
        assert!(!text.contains("[cost]"), "{text}");
        let place = |what: &str| text.find(what).unwrap();
        assert!(
            place("[control]") < place("[gain]") && place("[gain]") < place("[move]"),
            "{text}"
        );
        // Once more: nothing but the numbers changes.
        let again = drive_file(&text, &tuned).unwrap();
        assert_eq!(again, text);
    }
}
