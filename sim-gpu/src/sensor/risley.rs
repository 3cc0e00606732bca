//! Laser lines behind rotating wedge prisms, as in Livox's sensors with a rosette pattern.
//!
//! Each line passes through all prisms in turn. A prism has a flat face and a tilted one, which
//! turns about the forward axis; each face refracts the ray by Snell's law (Li, Liu and Sun, Optics
//! Express 25, 7677, 2017). Whether the pattern repeats from scan to scan depends on the prisms'
//! rates.

use std::f64::consts::TAU;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{MAX_RINGS, Rays, checked_ray_count};
use crate::config::{InvalidValue, positive, within};

/// Lines of lasers behind prisms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Risley {
    /// Pulses per second of each line; all lines fire at the same time.
    pub pulse_hz: f64,
    /// The duration of a scan, seconds.
    pub period_s: f64,
    /// The start of the first scan, seconds after all tilted faces stood upright.
    #[serde(default)]
    pub start_s: f64,
    /// The prisms, in the order in which light leaves through them.
    pub prism: Vec<Prism>,
    /// The lines; a point's ring is the index of its line.
    pub line: Vec<Line>,
}

/// A wedge prism.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prism {
    /// The angle between its faces. If negative, the second face is tilted instead of the first.
    pub wedge_deg: f64,
    /// Turns per second; negative in the opposite direction.
    pub rate_hz: f64,
    /// Index of refraction.
    pub index: f64,
}

/// The direction of a line before the prisms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Counterclockwise from forward.
    pub azimuth_deg: f64,
    /// Above the x-y plane.
    pub elevation_deg: f64,
}

impl Prism {
    /// `ray` behind both faces, `time_s` after the tilted face stood upright; `None` if it is
    /// reflected.
    fn refract(&self, ray: DVec3, time_s: f64) -> Option<DVec3> {
        let (sin_tilt, cos_tilt) = libm::sincos(self.wedge_deg.abs().to_radians());
        // The fraction is taken before the multiplication, so that late phases keep their digits.
        let turned_rad = TAU * (self.rate_hz * time_s).fract();
        let (sine, cosine) = libm::sincos(turned_rad);
        // Normals point against the light.
        let flat = DVec3::NEG_X;
        let tilted = DVec3::new(-cos_tilt, -sin_tilt * sine, sin_tilt * cosine);
        if self.wedge_deg >= 0.0 {
            refract(refract(ray, tilted, self.index.recip())?, flat, self.index)
        } else {
            let tilted = DVec3::new(-cos_tilt, sin_tilt * sine, -sin_tilt * cosine);
            refract(refract(ray, flat, self.index.recip())?, tilted, self.index)
        }
    }
}

/// Snell's law: the unit vector `ray` behind a face whose `normal` points against it. `ratio` is
/// the index before the face over that behind it. `None` for total internal reflection.
fn refract(ray: DVec3, normal: DVec3, ratio: f64) -> Option<DVec3> {
    let cos_in = -ray.dot(normal);
    let cos2_out = 1.0 - ratio * ratio * (1.0 - cos_in * cos_in);
    // Light from behind does not meet the face.
    (cos_in > 0.0 && cos2_out >= 0.0)
        .then(|| (ratio * ray + (ratio * cos_in - cos2_out.sqrt()) * normal).normalize())
}

impl Line {
    fn direction(&self) -> DVec3 {
        let (sin_azimuth, cos_azimuth) = libm::sincos(self.azimuth_deg.to_radians());
        let (sin_elevation, cos_elevation) = libm::sincos(self.elevation_deg.to_radians());
        DVec3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation)
    }
}

impl Risley {
    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        positive("risley.pulse_hz", self.pulse_hz)?;
        within("risley.pulse_hz", self.pulse_hz, 0.0..=1e9)?;
        positive("risley.period_s", self.period_s)?;
        // Eleven days: at 100 turns a second the phases still have eight digits.
        within("risley.start_s", self.start_s, 0.0..=1e6)?;
        let count = |key: &str, found: usize, most: f64| {
            if (1.0..=most).contains(&(found as f64)) {
                return Ok(());
            }
            Err(InvalidValue::new(key, format!("expected 1 to {most}, found {found}")))
        };
        count("risley.prism", self.prism.len(), 16.0)?;
        count("risley.line", self.line.len(), MAX_RINGS)?;
        for (i, prism) in self.prism.iter().enumerate() {
            let key = |field: &str| format!("risley.prism[{i}].{field}");
            within(&key("wedge_deg"), prism.wedge_deg, -60.0..=60.0)?;
            within(&key("rate_hz"), prism.rate_hz, -1e6..=1e6)?;
            within(&key("index"), prism.index, 1.0..=4.0)?;
        }
        for (i, line) in self.line.iter().enumerate() {
            let key = |field: &str| format!("risley.line[{i}].{field}");
            within(&key("azimuth_deg"), line.azimuth_deg, -60.0..=60.0)?;
            within(&key("elevation_deg"), line.elevation_deg, -60.0..=60.0)?;
        }
        checked_ray_count("risley", self.rays_in(1))?;
        let pulses = 0..self.pulses(1) as u32;
        if let Some((_, i)) = pulses.flat_map(|n| self.lines(n)).find(|(ray, _)| ray.is_none()) {
            let cause = "expected prisms that let its light through, found total reflection or a face turned away";
            return Err(InvalidValue::new(format!("risley.line[{i}]"), cause));
        }
        Ok(())
    }

    pub(super) fn rays_in(&self, scans: u32) -> u64 {
        self.pulses(scans).saturating_mul(self.line.len() as u64)
    }

    fn pulses(&self, scans: u32) -> u64 {
        // The conversion to an integer saturates.
        (self.pulse_hz * self.period_s * f64::from(scans)).round() as u64
    }

    fn lines(&self, pulse: u32) -> impl Iterator<Item = (Option<DVec3>, u16)> {
        let time_s = self.start_s + f64::from(pulse) / self.pulse_hz;
        self.line.iter().zip(0..).map(move |(line, number)| {
            let ray = line.direction();
            (self.prism.iter().try_fold(ray, |ray, prism| prism.refract(ray, time_s)), number)
        })
    }

    pub(super) fn rays(&self, keep_each: u32, scans: u32) -> Rays {
        // At most 2^26, as `validate` checks.
        let pulses = self.pulses(scans) as u32;
        let mut rays = Rays::with_capacity(pulses.div_ceil(keep_each) as usize * self.line.len());
        for pulse in (0..pulses).step_by(keep_each as usize) {
            let time_s = f64::from(pulse) / self.pulse_hz;
            for (ray, number) in self.lines(pulse) {
                // Rays that are totally reflected do not leave the sensor.
                if let Some(ray) = ray {
                    rays.push(ray, number, time_s);
                }
            }
        }
        rays
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prism(wedge_deg: f64) -> Prism {
        Prism { wedge_deg, rate_hz: 1.0, index: 1.5 }
    }

    #[test]
    fn a_thin_wedge_deflects_by_its_angle_times_the_index_less_one() {
        // The textbook's thin prism: (n - 1) alpha, towards its thick end, to second order.
        for wedge_deg in [0.5f64, -0.5] {
            for (time_s, up) in [(0.0, 1.0), (0.5, -1.0)] {
                let ray = prism(wedge_deg).refract(DVec3::X, time_s).unwrap();
                let expected_rad = 0.5 * wedge_deg.abs().to_radians();
                let off = ray.z.asin() + up * expected_rad;
                assert!(off.abs() < 1e-5 && ray.y.abs() < 1e-12, "{wedge_deg} {time_s}: {ray}");
            }
        }
    }

    #[test]
    fn a_wedge_deflects_as_snell_s_law_says() {
        // Tilted face first: asin(n sin(alpha - asin(sin(alpha) / n))).
        let alpha = 30f64.to_radians();
        let inside = alpha - (alpha.sin() / 1.5).asin();
        let expected_rad = (1.5 * inside.sin()).asin();
        let ray = prism(30.0).refract(DVec3::X, 0.0).unwrap();
        assert!((ray.z.asin() + expected_rad).abs() < 1e-14, "{ray}");
        // Flat face first: the light meets the tilted one at alpha from within.
        let expected_rad = (1.5 * alpha.sin()).asin() - alpha;
        let ray = prism(-30.0).refract(DVec3::X, 0.0).unwrap();
        assert!((ray.z.asin() + expected_rad).abs() < 1e-14, "{ray}");
        // sin(45 degrees) x 1.5 is above 1.
        assert!(prism(-45.0).refract(DVec3::X, 0.0).is_none());
    }

    #[test]
    fn light_that_a_face_is_turned_away_from_does_not_get_through() {
        let up = DVec3::new(0.5, 0.0, 0.75f64.sqrt());
        assert!(prism(60.0).refract(up, 0.0).is_none());
    }

    #[test]
    fn two_like_prisms_draw_a_rosette_from_the_middle_to_twice_their_deflection() {
        let opposite = Prism { rate_hz: -1.37, ..prism(10.0) };
        let line = Line { azimuth_deg: 0.0, elevation_deg: 0.0 };
        let (prism, line) = (vec![prism(10.0), opposite], vec![line]);
        let rosette = Risley { pulse_hz: 1e4, period_s: 3.0, start_s: 0.0, prism, line };
        rosette.validate().unwrap();
        let rays = rosette.rays(1, 1);
        let off_axis = |ray: &DVec3| ray.x.acos().to_degrees();
        let widest = rays.directions.iter().map(off_axis).fold(0.0, f64::max);
        let narrowest = rays.directions.iter().map(off_axis).fold(90.0, f64::min);
        // Thin prisms: 2 x 5 degrees; glass of 10 degrees adds some hundredths of that.
        assert!((10.0..10.4).contains(&widest) && narrowest < 0.1, "{narrowest} to {widest}");
    }
}
