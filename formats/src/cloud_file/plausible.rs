//! Judges whether numbers can be the points of a sweep.

use std::path::Path;

use crate::error::FormatError;

/// Beyond the range of every sensor on the ground, metres.
const FARTHEST_M: f64 = 1e4;

/// Distances of the farthest point of a sweep, metres: beyond them, the unit is probably another.
const EXPECTED_M: std::ops::RangeInclusive<f64> = 0.5..=2e3;

/// Farther than the nearest thing that a sensor on a vehicle, a tripod or a roof sees, metres.
const NEAREST_M: f64 = 50.0;

/// Judges the points of a sweep in a file, as [`judge_sweep`] does.
///
/// # Errors
/// As [`judge_sweep`].
pub fn check_sweep(
    points: impl IntoIterator<Item = [f64; 3]>,
    path: &Path,
    remedy: &str,
) -> Result<Option<String>, FormatError> {
    judge_sweep(points, remedy).map_err(|(part, cause)| FormatError::malformed(path, part, cause))
}

/// Judges whether `points` can be those of a sweep, metres from the sensor, and returns what is
/// doubtful. A lost return has no finite coordinate.
///
/// # Errors
/// The first point that has one or two finite coordinates, or one beyond 10 km, with the cause and
/// the `remedy`; no point with a position.
pub fn judge_sweep(
    points: impl IntoIterator<Item = [f64; 3]>,
    remedy: &str,
) -> Result<Option<String>, (String, String)> {
    let (mut nearest, mut farthest) = (f64::INFINITY, 0.0);
    for (i, point) in points.into_iter().enumerate() {
        let finite = point.iter().filter(|x| x.is_finite()).count();
        if !matches!(finite, 0 | 3) || point.iter().any(|x| x.is_finite() && x.abs() > FARTHEST_M) {
            let cause = format!("expected metres from the sensor, found {point:?}: {remedy}");
            return Err((format!("point {i}"), cause));
        }
        let range = point.iter().map(|x| x * x).sum::<f64>().sqrt();
        if range > 0.0 {
            (nearest, farthest) = (range.min(nearest), range.max(farthest));
        }
    }
    if farthest == 0.0 {
        let cause = "expected metres from the sensor, found no point with a position";
        return Err(("points".into(), cause.into()));
    }
    let (what, found, expected) = if !EXPECTED_M.contains(&farthest) {
        ("farthest", farthest, "0.5 m to 2 km; are the points in metres?")
    } else if nearest > NEAREST_M {
        ("nearest", nearest, "at most 50 m; is the origin the position of the sensor?")
    } else {
        return Ok(None);
    };
    Ok(Some(format!("the {what} point is {found:.3} m from the sensor: expected {expected}")))
}

/// What a cloud probably is instead of a whole object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unlike {
    /// The side of an object that faces a sensor.
    #[error(
        "is a scan of one side, and edge-64 learnt whole objects: its answer is often wrong; name a \
         model that learnt such scans: street-128, or one of `edgepuck train`"
    )]
    OneSide,
    /// A sweep of a sensor.
    #[error("looks like a sweep, and classifying names one object: detect finds those of a sweep")]
    Sweep,
}

/// Judges whether `points` can be those of one object, in any unit, and returns what they probably
/// are instead. Points that are not finite do not count.
///
/// # Errors
/// Points that are all in one place.
pub fn judge_object(points: &[[f64; 3]]) -> Result<Option<Unlike>, String> {
    let points = || points.iter().filter(|point| point.iter().all(|x| x.is_finite()));
    let (mut n, mut low, mut high) = (0, [f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points() {
        n += 1;
        (low, high) =
            ([0, 1, 2].map(|i| low[i].min(point[i])), [0, 1, 2].map(|i| high[i].max(point[i])));
    }
    if n > 0 && low == high {
        return Err(format!("expected points of an object, found {n} in one place, {low:?}"));
    }
    let length = |point: [f64; 3]| point.iter().map(|x| x * x).sum::<f64>().sqrt();
    let size = length([0, 1, 2].map(|i| high[i] - low[i]));
    let place = length([0, 1, 2].map(|i| (high[i] + low[i]) / 2.0));
    // Objects of streets in metres from the sensor; meshes are mostly nearer to their origin.
    if size < 30.0 && place > 3.0 * size && (2.0..200.0).contains(&place) {
        return Ok(Some(Unlike::OneSide));
    }
    // A sensor has most points near it; in objects, few are near the middle.
    let farthest = points().map(|point| length(*point)).fold(0.0, f64::max);
    let near = points().filter(|point| length(**point) < 0.3 * farthest).count();
    let is_sweep = n >= 10_000 && 2 * near > n && (20.0..2e3).contains(&farthest);
    Ok(is_sweep.then_some(Unlike::Sweep))
}

#[cfg(test)]
mod tests {
    use super::{Unlike, judge_object, judge_sweep};

    #[test]
    fn sweeps_of_another_unit_or_origin_or_without_points_are_told() {
        for (nearest, farthest, expected) in [
            (1.0, 80.0, "Ok(None)"),
            (1.0, 8000.0, "farthest point is 8000.000 m"),
            (0.01, 0.08, "farthest point is 0.080 m"),
            (280.0, 440.0, "nearest point is 280.000 m"),
            (0.0, 0.0, "found no point with a position"),
            (f64::NAN, f64::NAN, "found no point with a position"),
            (1.0, 49520.0, "\"point 2\", \"expected metres from the sensor, found [0.0, 49520.0"),
        ] {
            let middle = if nearest > 0.0 { [0.0, nearest, 0.0] } else { [0.0; 3] };
            let lost = if farthest > 0.0 { [0.0, farthest, 0.0] } else { [f64::NAN; 3] };
            let found = format!("{:?}", judge_sweep([[0.0; 3], middle, lost], "scale them"));
            assert!(found.contains(expected), "{found}");
        }
    }

    #[test]
    fn what_is_not_a_whole_object_is_told() {
        let grid =
            |n: i32| (-n..=n).flat_map(move |x| (-n..=n).map(move |y| [x, y].map(f64::from)));
        // The floor around a sensor, denser near it.
        let bent = |x: f64| x * x.abs().powi(3) / 216_000.0;
        let floor = grid(60).map(|[x, y]| [bent(x), bent(y), -1.5]);
        for (points, expected) in [
            (vec![[1.0, 2.0, 3.0]], Err("found 1 in one place, [1.0, 2.0, 3.0]")),
            (vec![[0.0; 3], [0.0; 3], [f64::NAN; 3]], Err("found 2 in one place")),
            (vec![], Ok(None)),
            (vec![[8.5, -2.4, -1.6], [9.0, -1.3, 0.2]], Ok(Some(Unlike::OneSide))),
            (vec![[-0.5; 3], [0.5; 3]], Ok(None)),
            (floor.collect(), Ok(Some(Unlike::Sweep))),
            (grid(60).map(|[x, y]| [x, y, 0.0]).collect(), Ok(None)),
        ] {
            match (judge_object(&points), expected) {
                (Err(found), Err(expected)) => assert!(found.contains(expected), "{found}"),
                (found, expected) => assert_eq!(found, expected.map_err(str::to_owned)),
            }
        }
    }
}
