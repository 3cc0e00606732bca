//! Whether numbers are the points of a sweep, metres from the sensor.

use std::path::Path;

use super::Warning;
use crate::error::FormatError;

/// Beyond the range of every sensor on the ground, metres.
const FARTHEST_M: f64 = 1e4;

/// Distances of the farthest point of a sweep, metres: beyond them, the unit is probably another.
const EXPECTED_M: std::ops::RangeInclusive<f64> = 0.5..=2e3;

/// Farther than the nearest thing that a sensor on a vehicle, a tripod or a roof sees, metres. A drone
/// is as far from all, and above them.
const NEAREST_M: f64 = 50.0;

/// The largest step between coordinates, metres: LiDARs measure ranges to millimetres.
const COARSEST_M: f32 = 0.005;

/// Whether `point` is a lost return, as sensors and drivers write it: it is at 0, 0, 0, or no coordinate is
/// finite.
#[must_use]
pub fn is_lost(point: [f64; 3]) -> bool {
    point == [0.0; 3] || !point.iter().any(|x| x.is_finite())
}

/// Judges the points of a sweep in a file, as [`judge_sweep`] does.
///
/// # Errors
/// As [`judge_sweep`].
pub fn check_sweep(
    points: impl IntoIterator<Item = [f64; 3], IntoIter: Clone>,
    path: &Path,
    remedy: &str,
) -> Result<Option<Warning>, FormatError> {
    judge_sweep(points, remedy).map_err(|(part, cause)| FormatError::malformed(path, part, cause))
}

/// Judges whether `points` can be those of a sweep, metres from the sensor, and returns what
/// speaks against it. Lost returns do not count.
///
/// # Errors
/// The first point that has one or two finite coordinates, or one beyond 10 km, with the cause and
/// the `remedy`; no point with a position.
pub fn judge_sweep(
    points: impl IntoIterator<Item = [f64; 3], IntoIter: Clone>,
    remedy: &str,
) -> Result<Option<Warning>, (String, String)> {
    let (mut nearest, mut farthest) = (f64::INFINITY, 0.0);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let points = points.into_iter();
    for (i, point) in points.clone().enumerate() {
        let finite = point.iter().filter(|x| x.is_finite()).count();
        if !matches!(finite, 0 | 3) || point.iter().any(|x| x.is_finite() && x.abs() > FARTHEST_M) {
            let cause = match point.iter().all(|x| x.is_finite()) {
                false => format!(
                    "expected three finite numbers, or none for a lost return, found {point:?}: remove \
                     the point"
                ),
                true => format!("expected metres from the sensor, found {point:?}: {remedy}"),
            };
            return Err((format!("point {i}"), cause));
        }
        let range = length(point);
        if range > 0.0 {
            (nearest, farthest) = (range.min(nearest), range.max(farthest));
            (low, high) =
                ([0, 1, 2].map(|i| low[i].min(point[i])), [0, 1, 2].map(|i| high[i].max(point[i])));
        }
    }
    if farthest == 0.0 {
        let cause = "expected metres from the sensor, found no point with a position";
        return Err(("points".into(), cause.into()));
    }
    let is_aside = (0..2).any(|axis| low[axis] > 0.0 || high[axis] < 0.0);
    Ok(if !EXPECTED_M.contains(&farthest) {
        Some(Warning::FarthestPoint(farthest))
    } else if nearest > NEAREST_M && is_aside {
        Some(Warning::NearestPoint(nearest))
    } else {
        unit_of_angles(points, low, high).map(Warning::Angles)
    })
}

/// The unit of angles, if the columns of `points`, between `low` and `high`, are probably a range and two
/// angles: none is beyond its bounds, and one fills a turn, also for the nearest tenth of the points. To
/// the sides, a sensor that looks ahead sees less far of what is near.
fn unit_of_angles(
    points: impl Iterator<Item = [f64; 3]> + Clone,
    low: [f64; 3],
    high: [f64; 3],
) -> Option<&'static str> {
    let fill = |turn: f64, range: usize, azimuth: usize| {
        let mut near: Vec<_> = points.clone().filter(|point| length(*point) > 0.0).collect();
        near.sort_unstable_by(|a, b| a[range].total_cmp(&b[range]));
        near.truncate(near.len().div_ceil(10));
        let (low, high) =
            near.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                (low.min(at[azimuth]), high.max(at[azimuth]))
            });
        high - low >= 0.7 * turn
    };
    let are_angles = |turn: f64, [range, azimuth, elevation]: [usize; 3]| {
        let extent = high[azimuth] - low[azimuth];
        low[range] >= 0.0
            && (0.9 * turn..=turn).contains(&extent)
            && (low[azimuth] >= 0.0 || low[azimuth] >= -turn / 2.0 && high[azimuth] <= turn / 2.0)
            && low[elevation] >= -turn / 4.0
            && high[elevation] <= turn / 4.0
            && fill(turn, range, azimuth)
    };
    let orders = [[0, 1, 2], [0, 2, 1], [2, 0, 1], [2, 1, 0]];
    let units = [("radians", std::f64::consts::TAU), ("degrees", 360.0)];
    let found =
        units.into_iter().find(|(_, turn)| orders.iter().any(|order| are_angles(*turn, *order)));
    found.map(|(unit, _)| unit)
}

/// Why the coordinates of `points`, metres, have probably lost digits: all are numbers of 32 bits,
/// which are too far apart at such coordinates.
pub fn coarse_coordinates(points: impl IntoIterator<Item = [f64; 3]>) -> Option<Warning> {
    let mut most = 0.0f32;
    for x in points.into_iter().flatten().filter(|x| x.is_finite()) {
        if f64::from(x as f32) != x {
            return None;
        }
        most = most.max((x as f32).abs());
    }
    let step_m = most.next_up() - most;
    (step_m > COARSEST_M).then_some(Warning::CoarseCoordinates { step_m, at_m: most })
}

pub(super) fn length(point: [f64; 3]) -> f64 {
    point.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::{Warning, coarse_coordinates, judge_sweep};

    #[test]
    fn sweeps_of_another_unit_or_origin_or_without_points_are_found() {
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
            let found = judge_sweep([[0.0; 3], middle, lost], "scale them");
            let found = format!("{:?}", found.map(|found| found.map(|it| it.to_string())));
            assert!(found.contains(expected), "{found}");
        }
        for (turn, unit) in [(360.0, "degrees"), (std::f64::consts::TAU, "radians")] {
            let turns = || (0..400).map(|n| turn * f64::from(n % 20) / 20.0);
            let spun = (0..).zip(turns());
            let spun = spun.map(|(n, azimuth)| [4.0 + f64::from(n / 20), azimuth, -turn / 24.0]);
            assert_eq!(judge_sweep(spun, ""), Ok(Some(Warning::Angles(unit))));
            // The same bounds, seen by a sensor that looks ahead.
            let ahead = turns().map(|y| y - turn / 2.0).map(|y| [y.abs(), y, -1.0]);
            assert_eq!(judge_sweep(ahead, ""), Ok(None));
        }
        let below_a_drone = [[-60.0, -40.0, -79.0], [55.0, 62.0, -80.0], [1.0, 2.0, -79.5]];
        assert_eq!(judge_sweep(below_a_drone, ""), Ok(None));
    }

    /// An f32 has 24 bits: at 5,400,000 m, between 2^22 and 2^23, the last is worth half a metre.
    #[test]
    fn coordinates_that_have_lost_digits_are_found() {
        let utm = [456_789.123, 5_400_000.456, 210.5];
        let rounded = utm.map(|x| f64::from(x as f32));
        let found = coarse_coordinates([[0.0; 3], rounded, [f64::NAN; 3]]);
        let expected = Warning::CoarseCoordinates { step_m: 0.5, at_m: 5_400_000.5 };
        assert_eq!(found, Some(expected));
        assert_eq!(coarse_coordinates([rounded, utm]), None);
        assert_eq!(coarse_coordinates([[1234.5, 0.0, -60_000.0]]), None);
    }
}
