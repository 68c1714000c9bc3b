//! What the user gets: tables for people, JSON for machines, CSV of every step, plots.

pub mod csv;
pub mod horizon;
pub mod identification;
pub mod log;
pub mod plot;
pub mod table;

/// A time for a CSV file: in whole nanoseconds, because 0.1 + 0.2 has no place in a time column.
#[must_use]
pub fn time(seconds: f64) -> f64 {
    (seconds * 1e9).round() / 1e9
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
