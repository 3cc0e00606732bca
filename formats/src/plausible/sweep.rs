//! Whether numbers are the points of a sweep, metres from the sensor.

#[cfg(feature = "poses")]
use std::collections::BTreeMap;
use std::path::Path;

#[cfg(feature = "poses")]
use glam::{DMat3, DVec3};

use super::{Warning, bounds};
use crate::error::FormatError;

/// Beyond the range of every sensor on the ground, metres.
const FARTHEST_M: f64 = 1e4;

/// Distances of the farthest point of a sweep, metres: beyond them, the unit is probably another.
const EXPECTED_M: std::ops::RangeInclusive<f64> = 0.5..=2e3;

/// Farther than the nearest thing that a sensor on a vehicle, a tripod or a roof sees, metres. A drone
/// is as far from all, and above them.
const NEAREST_M: f64 = 50.0;

/// Longer than cars, vans and trucks without trailers, metres.
#[cfg(feature = "poses")]
const LONGEST_OBJECT_M: f64 = 12.0;

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
        }
    }
    if farthest == 0.0 {
        let cause = "expected metres from the sensor, found no point with a position";
        return Err(("points".into(), cause.into()));
    }
    let [low, high] = bounds(points.clone().filter(|point| length(*point) > 0.0));
    let is_aside = (0..2).any(|axis| low[axis] > 0.0 || high[axis] < 0.0);
    Ok(if !EXPECTED_M.contains(&farthest) {
        Some(Warning::FarthestPoint(farthest))
    } else if nearest > NEAREST_M && is_aside {
        Some(Warning::NearestPoint(nearest))
    } else {
        unit_of_angles(points, low, high).map(Warning::Angles)
    })
}

/// Why `points`, metres from the sensor, z up, are probably not those that a sensor on a vehicle, a robot
/// or a mast sees around it: they are few, or of one object, or the ground is not below the origin. Where no
/// ground is found, `other_axis` tells whether another axis than z points up.
#[cfg(feature = "poses")]
#[must_use]
pub fn judge_surroundings(
    points: &[[f32; 3]],
    other_axis: impl FnOnce() -> Option<Warning>,
) -> Option<Warning> {
    let points = points.iter().map(|point| DVec3::from_array(point.map(f64::from)));
    let returns: Vec<_> = points.filter(|at| at.is_finite() && *at != DVec3::ZERO).collect();
    if returns.len() < 100 {
        return Some(Warning::FewPoints(returns.len()));
    }
    let [low, high] = bounds(returns.iter().map(DVec3::to_array)).map(DVec3::from_array);
    let is_aside = low.x > 0.0 || low.y > 0.0 || high.x < 0.0 || high.y < 0.0;
    if is_aside && (high - low).length() < LONGEST_OBJECT_M {
        return Some(Warning::OneObject((high - low).to_array()));
    }
    let Some(ground) = ground(&returns) else { return other_axis() };
    let slope_deg = libm::atan(ground.truncate().length()).to_degrees();
    // Streets rise by less, and vehicles stand along them.
    if slope_deg > 12.0 {
        return Some(Warning::TiltedGround(slope_deg));
    }
    (!(-30.0..-0.15).contains(&ground.z)).then_some(Warning::GroundAt(ground.z))
}

/// The plane of the ground, z = a x + b y + c: through the lowest points of most places near the origin, if more
/// is above than below.
#[cfg(feature = "poses")]
fn ground(returns: &[DVec3]) -> Option<DVec3> {
    let near = || returns.iter().filter(|at| at.truncate().length() < 12.0);
    let mut places = BTreeMap::new();
    for at in near() {
        let place = [at.x, at.y].map(|x| x.floor() as i32);
        let lowest = places.entry(place).or_insert(*at);
        *lowest = if at.z < lowest.z { *at } else { *lowest };
    }
    let n = places.len();
    if n < 30 {
        return None;
    }
    let (mut lowest, mut plane): (Vec<DVec3>, _) = (places.into_values().collect(), DVec3::ZERO);
    let above = |plane: DVec3, at: &DVec3| at.z - plane.dot(at.with_z(1.0));
    // Least squares, without what stands too high.
    for limit_m in [1.0, 0.5, 0.3] {
        let (mut squares, mut sums) = (DMat3::ZERO, DVec3::ZERO);
        for at in &lowest {
            let row = at.with_z(1.0);
            squares += DMat3::from_cols(row.x * row, row.y * row, row);
            sums += at.z * row;
        }
        plane = squares.inverse() * sums;
        lowest.retain(|at| above(plane, at).abs() < limit_m);
    }
    let over = near().filter(|at| above(plane, at) > 0.5).count();
    let under = near().filter(|at| above(plane, at) < -0.5).count();
    (2 * lowest.len() > n && over >= 4 * under).then_some(plane)
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
    coarser_than(COARSEST_M, points)
}

/// As [`coarse_coordinates`], beyond a step in the unit of the points.
pub(super) fn coarser_than(
    coarsest: f32,
    points: impl IntoIterator<Item = [f64; 3]>,
) -> Option<Warning> {
    let mut most = 0.0f32;
    for x in points.into_iter().flatten().filter(|x| x.is_finite()) {
        if f64::from(x as f32) != x {
            return None;
        }
        most = most.max((x as f32).abs());
    }
    let step_m = most.next_up() - most;
    (step_m > coarsest).then_some(Warning::CoarseCoordinates { step_m, at_m: most })
}

pub(super) fn length(point: [f64; 3]) -> f64 {
    point.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// A street that rises by 10 % to one side: the ground in rings 2 to 40 m away, and walls.
    #[cfg(feature = "poses")]
    #[test]
    fn surroundings_have_their_ground_below_the_sensor() {
        let judge = |points: &[[f32; 3]]| judge_surroundings(points, || Some(Warning::OnePose));
        let street = |ground_m: f32| {
            let at = move |n: u16, r: f32, up: f32| {
                let (sin, cos) = (2.0 * f32::from(n % 180)).to_radians().sin_cos();
                [r * cos, r * sin, ground_m + up + 0.1 * r * sin]
            };
            let ground = (0..3600).map(move |n| at(n, 2.0 * f32::from(n / 180 + 1), 0.0));
            ground.chain((0..3600).map(move |n| at(n, 8.0, 0.2 * f32::from(n / 180))))
        };
        for (ground_m, expected) in [
            (-1.73, None),
            (-0.4, None),
            (-12.0, None),
            (0.02, Some("the ground is at z = 0.0 m")),
            (1.2, Some("the ground is at z = 1.2 m")),
            (-101.7, Some("the ground is at z = -101.7 m")),
        ] {
            let found = judge(&street(ground_m).collect::<Vec<_>>()).map(|it| it.to_string());
            assert_eq!(found.is_some(), expected.is_some(), "{ground_m}: {found:?}");
            assert!(found.unwrap_or_default().starts_with(expected.unwrap_or_default()));
        }
        for tilt_deg in [15.0f32, 20.0, 45.0] {
            let (sin, cos) = tilt_deg.to_radians().sin_cos();
            let tilted = street(-1.73).map(|[x, y, z]| [cos * x + sin * z, y, cos * z - sin * x]);
            let found = judge(&tilted.collect::<Vec<_>>());
            assert!(matches!(found, Some(Warning::TiltedGround(_))), "{tilt_deg}: {found:?}");
        }
        let on_its_head: Vec<_> = street(-1.73).map(|[x, y, z]| [x, -y, -z]).collect();
        assert_eq!(judge(&on_its_head), Some(Warning::OnePose), "no ground was found");
        let chair: Vec<_> = (0..500u16).map(|n| [3.0, 1e-3 * f32::from(n), 0.0]).collect();
        // On each side of the sensor.
        for [cos, sin] in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]] {
            let at =
                |[x, y, z]: [f32; 3]| [cos * x - sin * (y - 0.2), sin * x + cos * (y - 0.2), z];
            let chair: Vec<_> = chair.iter().map(|point| at(*point)).collect();
            assert!(matches!(judge(&chair), Some(Warning::OneObject(_))));
        }
        assert_eq!(judge(&chair[..1]), Some(Warning::FewPoints(1)));
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
