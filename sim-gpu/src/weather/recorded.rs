//! Weather applied to points that a sensor measured in clear air.

use super::{Air, AirBeam, Medium, Scattered};
use crate::sensor::DetectionLimit;
use formats::Scan;
use formats::rng::StreamKey;
use glam::DVec3;

/// Counts of the points of a scan by their fate in the weather.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fates {
    /// Points at the same place, weaker.
    pub kept: usize,
    /// Points whose beams returned from the air instead.
    pub scattered: usize,
    /// Points that became too weak to be detected.
    pub lost: usize,
    /// Those of the lost points that are below the detection limit in clear air, too.
    pub too_weak_before: usize,
    /// Points that are not finite or lie in the sensor. They are kept unchanged.
    pub passed_over: usize,
}

/// Applies this `air` to `scan`, whose points were measured in clear air from `sensor_m`, for a
/// sensor that reports the strongest return and has this detection `limit`.
///
/// `brightness` holds each point's reflectivity times the cosine of the incidence. It becomes the
/// scan's intensity. The beam of point i uses the random numbers i of `stream`.
#[must_use]
pub fn in_weather(
    scan: &Scan,
    brightness: &[f32],
    sensor_m: DVec3,
    air: &Air,
    limit: &DetectionLimit,
    stream: StreamKey,
) -> (Scan, Fates) {
    let mut fates = Fates::default();
    let (mut kept, mut found) = (Vec::new(), Vec::new());
    for (number, (&point, &brightness)) in (0u32..).zip(scan.positions.iter().zip(brightness)) {
        let from_sensor =
            DVec3::from_array(scan.origin) + DVec3::from(point.map(f64::from)) - sensor_m;
        let end_m = from_sensor.length();
        if !(end_m.is_finite() && end_m > 0.0) {
            fates.passed_over += 1;
            kept.push(number as usize);
            found.push(Scattered {
                range_m: f64::NAN,
                power: 0.0,
                brightness: brightness.into(),
                medium: Medium::Surface,
            });
            continue;
        }
        let (origin, direction) = (sensor_m, from_sensor / end_m);
        let brightness = f64::from(brightness);
        let along = AirBeam { origin, direction, end_m, stream, number };
        match strongest(air, &along, brightness, limit.power()) {
            None => {
                fates.lost += 1;
                let before = brightness / end_m.powi(2);
                fates.too_weak_before += usize::from(before < limit.power());
            }
            Some(one) => {
                let is_surface = one.medium == Medium::Surface;
                *(if is_surface { &mut fates.kept } else { &mut fates.scattered }) += 1;
                kept.push(number as usize);
                found.push(one);
            }
        }
    }
    (moved(scan, sensor_m, &kept, &found), fates)
}

/// The strongest return of the air along a beam that ends at a surface of this `brightness`, if not
/// below `least`.
fn strongest(air: &Air, beam: &AirBeam, brightness: f64, least: f64) -> Option<Scattered> {
    let range_m = beam.end_m;
    let brightness = brightness * air.transmission(beam.origin, beam.direction, range_m);
    let power = brightness / range_m.powi(2);
    let mut best = Scattered { range_m, power, brightness, medium: Medium::Surface };
    air.scatter(beam, |one| {
        if one.power > best.power {
            best = one;
        }
    });
    (best.power >= least).then_some(best)
}

/// Removes the attributes of a surface from point `i` of `scan`, and sets its range.
pub(crate) fn without_surface(scan: &mut Scan, i: usize, range_m: f64) {
    if let Some(ranges_m) = &mut scan.range_m {
        ranges_m[i] = range_m as f32;
    }
    for numbers in [&mut scan.triangle, &mut scan.object].into_iter().flatten() {
        numbers[i] = u32::MAX;
    }
    if let Some(normals) = &mut scan.normal {
        normals[i] = [0.0; 3];
    }
}

/// The points of `scan` with these numbers, moved to where they were `found`.
fn moved(scan: &Scan, sensor_m: DVec3, kept: &[usize], found: &[Scattered]) -> Scan {
    let mut moved = scan.select(kept);
    let is_of_air = |one: &Scattered| one.medium != Medium::Surface;
    let from_origin = sensor_m - DVec3::from_array(scan.origin);
    for (i, one) in found.iter().enumerate().filter(|(_, one)| is_of_air(one)) {
        let from_sensor = DVec3::from(moved.positions[i].map(f64::from)) - from_origin;
        let position = from_sensor.normalize() * one.range_m + from_origin;
        moved.positions[i] = position.as_vec3().to_array();
        without_surface(&mut moved, i, one.range_m);
    }
    moved.intensity = Some(found.iter().map(|one| one.brightness as f32).collect());
    moved.medium = Some(found.iter().map(|one| one.medium as u8).collect());
    // These hold for clear air only.
    (moved.power, moved.reflectivity) = (None, None);
    moved
}
