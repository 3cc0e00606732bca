//! Judges whether numbers can be the points of a sweep.

use std::path::Path;

use crate::error::FormatError;

/// Beyond the range of every sensor on the ground, metres.
const FARTHEST_M: f64 = 1e4;

/// Distances of the farthest point of a sweep, metres: beyond them, the unit is probably another.
const EXPECTED_M: std::ops::RangeInclusive<f64> = 0.5..=2e3;

/// Checks that `points` can be those of a sweep in a file, as [`judge_sweep`] does.
///
/// # Errors
/// The first point that cannot be one; `remedy` says what to do then.
pub fn check_sweep(
    points: impl IntoIterator<Item = [f64; 3]>,
    path: &Path,
    remedy: &str,
) -> Result<(), FormatError> {
    judge_sweep(points).map_err(|(i, cause)| {
        FormatError::malformed(path, format!("point {i}"), format!("{cause}: {remedy}"))
    })
}

/// Checks that `points` can be those of a sweep, metres from the sensor. A lost return has no
/// finite coordinate.
///
/// # Errors
/// The first point that has one or two finite coordinates, or one beyond 10 km, and what is wrong.
pub fn judge_sweep(points: impl IntoIterator<Item = [f64; 3]>) -> Result<(), (usize, String)> {
    let is_wrong = |point: &[f64; 3]| {
        let finite = point.iter().filter(|x| x.is_finite()).count();
        !matches!(finite, 0 | 3) || point.iter().any(|x| x.is_finite() && x.abs() > FARTHEST_M)
    };
    match points.into_iter().enumerate().find(|(_, point)| is_wrong(point)) {
        None => Ok(()),
        Some((i, point)) => Err((i, format!("expected metres from the sensor, found {point:?}"))),
    }
}

/// Why the points of a sweep are probably not metres from the sensor, if their distances say so.
pub fn doubtful_sweep(points: impl IntoIterator<Item = [f64; 3]>) -> Option<String> {
    let squares = points.into_iter().map(|point| point.iter().map(|x| x * x).sum::<f64>());
    let farthest = squares.filter(|square| *square > 0.0).fold(0.0, f64::max).sqrt();
    if farthest == 0.0 {
        return Some("no point has a position: expected points in metres from the sensor".into());
    }
    (!EXPECTED_M.contains(&farthest)).then(|| {
        format!(
            "the farthest point is {farthest:.3} m from the sensor: expected 0.5 m to 2 km; are \
             the points in metres?"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::doubtful_sweep;

    #[test]
    fn sweeps_of_another_unit_or_without_points_are_doubted() {
        for (farthest, expected) in [
            (80.0, None),
            (8000.0, Some("8000.000 m")),
            (0.08, Some("0.080 m")),
            (0.0, Some("no point has a position")),
            (f64::NAN, Some("no point has a position")),
        ] {
            let found = doubtful_sweep([[0.0; 3], [0.0, farthest, 0.0], [f64::NAN; 3]]);
            assert_eq!(found.is_some(), expected.is_some(), "{farthest}: {found:?}");
            assert!(found.unwrap_or_default().contains(expected.unwrap_or_default()));
        }
    }
}
