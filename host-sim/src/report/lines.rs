//! Lines with no more points than can be seen, cut where the picture ends.

/// Points of a line, in the order in which they are joined.
pub(super) type Points = Vec<(f64, f64)>;

/// Columns of a picture in which a line over time is looked at, each with its first, least, greatest and last
/// point: 2000 points.
const COLUMNS: usize = 500;
/// What is nearer than this share of the picture is the same place.
const NEAR: f64 = 1.0 / 1000.0;

/// A line that looks the same: over time with every peak, in a plane with every turn.
pub(super) fn thinned(points: &[(f64, f64)]) -> Points {
    if points.len() <= 4 * COLUMNS {
        return points.to_vec();
    }
    if points.is_sorted_by(|a, b| a.0 <= b.0) {
        peaks(points)
    } else {
        path(points)
    }
}

/// First, least, greatest and last point of every column.
fn peaks(points: &[(f64, f64)]) -> Points {
    let (first, last) = (points[0].0, points[points.len() - 1].0);
    let column = |x: f64| ((x - first) / (last - first) * COLUMNS as f64) as usize;
    let mut kept = Vec::new();
    for within in points.chunk_by(|a, b| column(a.0) == column(b.0)) {
        let least = (0..within.len()).min_by(|a, b| within[*a].1.total_cmp(&within[*b].1));
        let greatest = (0..within.len()).max_by(|a, b| within[*a].1.total_cmp(&within[*b].1));
        let ends = [Some(0), Some(within.len() - 1)];
        let mut indices: Vec<usize> = ends
            .into_iter()
            .chain([least, greatest])
            .flatten()
            .collect();
        indices.sort_unstable();
        indices.dedup();
        kept.extend(indices.into_iter().map(|index| within[index]));
    }
    kept
}

/// Every point that is not where the one before it is.
fn path(points: &[(f64, f64)]) -> Points {
    let [x, y] = [span(points, |point| point.0), span(points, |point| point.1)];
    let size = |(low, high): (f64, f64)| (high - low).max(f64::MIN_POSITIVE) * NEAR;
    let (dx, dy) = (size(x), size(y));
    let mut kept: Points = Vec::new();
    for point in points {
        let apart = kept
            .last()
            .is_none_or(|last| (point.0 - last.0).abs() > dx || (point.1 - last.1).abs() > dy);
        if apart {
            kept.push(*point);
        }
    }
    kept.extend(points.last());
    kept
}

/// Least and greatest finite value; the first is the greater where there is none.
pub(super) fn span(points: &[(f64, f64)], value: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
    let values = points.iter().map(value).filter(|value| value.is_finite());
    values.fold((f64::MAX, f64::MIN), |(low, high), x| {
        (low.min(x), high.max(x))
    })
}

/// The pieces of a line that are between two heights.
pub(super) fn cut(points: &[(f64, f64)], (low, high): (f64, f64)) -> Vec<Points> {
    let mut pieces = vec![Vec::new()];
    let inside = |y: f64| (low..=high).contains(&y);
    let edge = |y: f64| if y > high { high } else { low };
    // Where the way from one point to the next meets a height.
    let crossing = |a: (f64, f64), b: (f64, f64), height: f64| {
        let share = (height - a.1) / (b.1 - a.1);
        (a.0 + share * (b.0 - a.0), height)
    };
    for (index, point) in points.iter().enumerate() {
        let before = index.checked_sub(1).map(|before| points[before]);
        let Some(piece) = pieces.last_mut() else {
            break;
        };
        match before {
            None if inside(point.1) => piece.push(*point),
            None => {}
            Some(before) => match (inside(before.1), inside(point.1)) {
                (true, true) => piece.push(*point),
                (true, false) => {
                    piece.push(crossing(before, *point, edge(point.1)));
                    pieces.push(Vec::new());
                }
                (false, true) => {
                    piece.push(crossing(before, *point, edge(before.1)));
                    piece.push(*point);
                }
                (false, false) if edge(before.1) != edge(point.1) => {
                    piece.push(crossing(before, *point, edge(before.1)));
                    piece.push(crossing(before, *point, edge(point.1)));
                    pieces.push(Vec::new());
                }
                (false, false) => {}
            },
        }
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_peak_is_lost() {
        let mut points: Points = (0..1_000_000)
            .map(|k| (f64::from(k), (f64::from(k) * 1e-3).sin()))
            .collect();
        points[123_456].1 = 7.0;
        points[654_321].1 = -7.0;
        let thin = thinned(&points);
        assert!(thin.len() <= 4 * (COLUMNS + 1), "{}", thin.len());
        assert!(thin.contains(&(123_456.0, 7.0)) && thin.contains(&(654_321.0, -7.0)));
        assert!(thin.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!((thin[0], thin.last()), (points[0], points.last()));
        // What is short stays as it is.
        assert_eq!(thinned(&points[..2000]), points[..2000]);
    }

    #[test]
    fn a_portrait_keeps_its_shape() {
        let spiral: Points = (0..100_000)
            .map(|k| {
                let angle = f64::from(k) * 1e-2;
                let radius = (-angle / 20.0).exp();
                (radius * angle.cos(), radius * angle.sin())
            })
            .collect();
        let thin = thinned(&spiral);
        assert!(thin.len() < 20_000, "{}", thin.len());
        let reaches = |points: &Points| span(points, |point| point.0);
        let (all, kept) = (reaches(&spiral), reaches(&thin));
        assert!((all.0 - kept.0).abs() < 2e-3 && (all.1 - kept.1).abs() < 2e-3);
        assert_eq!(thin.last(), spiral.last());
    }

    #[test]
    fn what_is_outside_is_cut_at_the_edge() {
        let points = [(0.0, 0.0), (1.0, 4.0), (2.0, 0.0), (3.0, -4.0), (4.0, 4.0)];
        let pieces = cut(&points, (-2.0, 2.0));
        assert_eq!(
            pieces,
            [
                vec![(0.0, 0.0), (0.5, 2.0)],
                vec![(1.5, 2.0), (2.0, 0.0), (2.5, -2.0)],
                vec![(3.25, -2.0), (3.75, 2.0)]
            ]
        );
        assert!(cut(&[(0.0, 9.0), (1.0, 9.0)], (-2.0, 2.0)).is_empty());
    }
}
