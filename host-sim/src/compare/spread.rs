//! What a figure is over many plants.

use serde::Serialize;

/// Median, 95 % and worst of a figure of which less is better; none where it is one of those that have none,
/// which are worse than any other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// What half of the plants keep.
    pub median: Option<f64>,
    /// What 95 % keep.
    pub most: Option<f64>,
    /// The worst of all.
    pub worst: Option<f64>,
}

impl Spread {
    /// Of figures, one for each plant.
    #[must_use]
    pub fn of(figures: &[Option<f64>]) -> Self {
        let each = figures.iter().map(|figure| figure.unwrap_or(f64::INFINITY));
        let mut sorted: Vec<f64> = each.collect();
        sorted.sort_by(f64::total_cmp);
        // The smallest figure that the share keeps.
        let quantile = |share: f64| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            let figure = sorted.get(rank.saturating_sub(1)).copied();
            figure.filter(|figure| figure.is_finite())
        };
        Self {
            median: quantile(0.5),
            most: quantile(0.95),
            worst: quantile(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_figure_is_worse_than_all() {
        let mut figures: Vec<Option<f64>> = (1..=20).map(|k| Some(f64::from(k))).collect();
        let all = Spread::of(&figures);
        assert_eq!((all.median, all.most), (Some(10.0), Some(19.0)));
        figures[3] = None;
        let one_less = Spread::of(&figures);
        assert_eq!((one_less.most, one_less.worst), (Some(20.0), None));
    }
}
