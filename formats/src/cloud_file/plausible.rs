//! Judges whether numbers can be the points of a sweep.

use std::path::Path;

use crate::error::FormatError;

/// Beyond the range of every sensor on the ground, metres.
const FARTHEST_M: f64 = 1e4;

/// Checks that `points` can be those of a sweep, metres from the sensor. A lost return has no
/// finite coordinate.
///
/// # Errors
/// The first point that has one or two finite coordinates, or one beyond 10 km; `remedy` says what
/// to do then.
pub fn check_sweep(
    points: impl IntoIterator<Item = [f64; 3]>,
    path: &Path,
    remedy: &str,
) -> Result<(), FormatError> {
    let is_wrong = |point: &[f64; 3]| {
        let finite = point.iter().filter(|x| x.is_finite()).count();
        !matches!(finite, 0 | 3) || point.iter().any(|x| x.is_finite() && x.abs() > FARTHEST_M)
    };
    match points.into_iter().enumerate().find(|(_, point)| is_wrong(point)) {
        None => Ok(()),
        Some((i, point)) => {
            let cause = format!("expected metres from the sensor, found {point:?}: {remedy}");
            Err(FormatError::malformed(path, format!("point {i}"), cause))
        }
    }
}
