//! Corruptions of recorded scans: those of Robo3D (Kong et al., ICCV 2023), each by its physics.
//!
//! A recorded scan is assumed to be of clear air and of a sensor at rest. [`crate::weather`] has
//! rain, snow and fog; this module has the others.
//!
//! # Wet ground
//!
//! A film of water transmits a part `t` of the light on the way in and out, by Fresnel's formulas,
//! and reflects some back to the ground. A ground of reflectivity rho appears as
//!
//! ```text
//! rho' = t t rho / (1 - r rho),    r = 1 - t
//! ```
//!
//! mixed with rho by the share `film / texture` while the film does not cover the ground's texture
//! of 1.2 mm (Hahner et al., CVPR 2022, after Shin et al.). The rest of the light is reflected as
//! by a mirror.

use formats::Scan;
use formats::rng::StreamKey;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, within};
use crate::effects::Weather;
use crate::sensor::DetectionLimit;
use crate::weather::without_surface;

/// Index of refraction of water over that of air.
const WATER: f64 = 1.33 / 1.0003;

/// The depth of a film that covers the texture of a road, metres (Hahner et al. 2022).
const TEXTURE_M: f64 = 1.2e-3;

/// A corruption of a recorded scan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Corruption {
    /// Rain, snow, fog or haze.
    Weather(Box<Weather>),
    /// The ground is wet.
    WetGround {
        /// The depth of the film of water, metres.
        film_m: f64,
    },
    /// The sensor moves uniformly during the scan, and its points are motion-distorted.
    Motion {
        /// Along x of the points, metres per second.
        speed_m_s: f64,
        /// To the left, degrees per second.
        yaw_rate_deg_s: f64,
    },
    /// Lasers are broken or covered.
    BeamsMissing {
        /// The part of the lasers, 0 to 1.
        share: f64,
    },
    /// Pulses of another sensor are taken for returns, at any time and of any strength.
    Crosstalk {
        /// The part of the points, 0 to 1.
        share: f64,
    },
    /// A film of dirt on the window, which light crosses twice: dark or distant points are lost.
    DirtyWindow {
        /// The part of the light that the film transmits once, 0 to 1.
        transmission: f64,
    },
    /// A sensor of fewer lasers and a slower pulse.
    FewerBeams {
        /// The part of the lasers that remain, evenly spaced, 0 to 1.
        lasers: f64,
        /// The sensor fires at every `keep_each`-th azimuth.
        keep_each: u32,
    },
}

/// A recorded scan, with the inputs of corruptions.
pub struct Recorded<'a> {
    /// The points, in the frame of their file.
    pub scan: &'a Scan,
    /// Reflectivity times the cosine of the incidence, of each point.
    pub brightness: &'a [f32],
    /// Whether each point lies on the ground.
    pub is_ground: &'a [bool],
    /// The position of the sensor.
    pub sensor_m: DVec3,
    /// The sensor's detection limit.
    pub limit: DetectionLimit,
    /// The nearest and the farthest range that the sensor measures, metres.
    pub range_m: [f64; 2],
    /// The stream of all random numbers.
    pub stream: StreamKey,
}

impl Corruption {
    /// Checks all numbers, under names that begin with `key`.
    pub fn validate(&self, key: &str) -> Result<(), InvalidValue> {
        let share = |field: &str, x: f64| within(&format!("{key}.{field}"), x, 0.0..=1.0);
        match self {
            Self::Weather(weather) => weather
                .validate()
                .map_err(|error| InvalidValue { key: format!("{key}.{}", error.key), ..error }),
            Self::WetGround { film_m } => within(&format!("{key}.film_m"), *film_m, 0.0..=1.0),
            Self::Motion { speed_m_s, yaw_rate_deg_s } => {
                within(&format!("{key}.speed_m_s"), *speed_m_s, -300.0..=300.0)?;
                within(&format!("{key}.yaw_rate_deg_s"), *yaw_rate_deg_s, -3600.0..=3600.0)
            }
            Self::BeamsMissing { share: missing } => share("share", *missing),
            Self::Crosstalk { share: foreign } => share("share", *foreign),
            Self::DirtyWindow { transmission } => share("transmission", *transmission),
            Self::FewerBeams { lasers, keep_each } => {
                within(&format!("{key}.keep_each"), f64::from(*keep_each), 1.0..=1e6)?;
                share("lasers", *lasers)
            }
        }
    }
}

/// Every returned scan has the brightness of its points as `intensity`.
impl Recorded<'_> {
    /// The number of points that are below the detection limit as recorded.
    #[must_use]
    pub fn too_weak_before(&self) -> usize {
        let is_too_weak = |i: &usize| self.power(*i, 1.0) < self.limit.power();
        (0..self.scan.len()).filter(is_too_weak).count()
    }

    fn power(&self, i: usize, left: f64) -> f64 {
        f64::from(self.brightness[i]) * left / self.seen_from_sensor(i).length_squared()
    }

    /// The scan on wet ground, with the points that are still detected.
    #[must_use]
    pub fn wet_ground(&self, film_m: f64) -> Scan {
        let share = (film_m / TEXTURE_M).min(1.0);
        self.dimmed(|i, from_sensor| {
            let Some(direction) = from_sensor.try_normalize().filter(|_| self.is_ground[i]) else {
                return 1.0;
            };
            let cos_incidence = direction.z.abs();
            let rho = (f64::from(self.brightness[i]) / cos_incidence.max(1e-3)).min(1.0);
            1.0 - share + share * wet(rho, cos_incidence)
        })
    }

    /// The scan through a window with this transmission.
    #[must_use]
    pub fn dirty_window(&self, transmission: f64) -> Scan {
        self.dimmed(|_, _| transmission * transmission)
    }

    /// The points that are still detected if the power of point i, at this place relative to the
    /// sensor, is multiplied by `left`.
    fn dimmed(&self, left: impl Fn(usize, DVec3) -> f64) -> Scan {
        let of_point = |i: usize| {
            let left = left(i, self.seen_from_sensor(i));
            let power = self.power(i, left);
            // Points in the sensor or not finite have no power to compare, and points that lose no
            // power were detected.
            let is_detected = left >= 1.0 || !power.is_finite() || power >= self.limit.power();
            is_detected.then(|| (i, (f64::from(self.brightness[i]) * left) as f32))
        };
        let (kept, brightness): (Vec<usize>, Vec<f32>) =
            (0..self.scan.len()).filter_map(of_point).unzip();
        let mut scan = self.scan.select(&kept);
        set_brightness(&mut scan, brightness);
        scan
    }

    /// The scan of a sensor that moves along x and turns to the left; `None` if the scan has no
    /// times. Normals and poses are dropped, as they hold for the recorded scan only.
    #[must_use]
    pub fn motion(&self, speed_m_s: f64, yaw_rate_deg_s: f64) -> Option<Scan> {
        let times_s = self.scan.time_s.as_ref()?;
        let rate_rad_s = yaw_rate_deg_s.to_radians();
        let mut scan = self.scan.clone();
        for (i, point) in scan.positions.iter_mut().enumerate() {
            let time_s = f64::from(times_s[i]);
            // The sensor's position on its arc, which bends to the left.
            let turned_rad = rate_rad_s * time_s;
            let gone_m = if rate_rad_s == 0.0 {
                DVec3::new(speed_m_s * time_s, 0.0, 0.0)
            } else {
                let radius_m = speed_m_s / rate_rad_s;
                DVec3::new(libm::sin(turned_rad), 1.0 - libm::cos(turned_rad), 0.0) * radius_m
            };
            let seen = DQuat::from_rotation_z(-turned_rad) * (self.seen_from_sensor(i) - gone_m);
            *point = self.in_file(seen);
            if let Some(ranges_m) = &mut scan.range_m {
                ranges_m[i] = seen.length() as f32;
            }
        }
        (scan.normal, scan.sensor_m, scan.attitude_rad) = (None, None, None);
        set_brightness(&mut scan, self.brightness.to_vec());
        Some(scan)
    }

    /// The scan without this share of the rings, drawn at random; `None` if it has no rings.
    #[must_use]
    pub fn beams_missing(&self, share: f64) -> Option<Scan> {
        let rings = self.scan.ring.as_ref()?;
        let n_rings = rings.iter().max().map_or(0, |&most| u64::from(most) + 1);
        let mut order: Vec<u64> = (0..n_rings).collect();
        order.sort_by(|&a, &b| self.stream.unit(a).total_cmp(&self.stream.unit(b)));
        let mut is_missing = vec![false; n_rings as usize];
        let missing = (share * n_rings as f64).round() as usize;
        order.iter().take(missing).for_each(|&ring| is_missing[ring as usize] = true);
        Some(self.where_point(|i| !is_missing[usize::from(rings[i])]))
    }

    /// The scan in which this share of points are another sensor's pulses, uniform along the beam.
    #[must_use]
    pub fn crosstalk(&self, share: f64) -> Scan {
        let mut scan = self.scan.clone();
        let mut brightness = self.brightness.to_vec();
        for (i, brightness) in brightness.iter_mut().enumerate() {
            let from_sensor = self.seen_from_sensor(i);
            let draw = |n: u64| self.stream.unit(3 * i as u64 + n);
            let Some(direction) = from_sensor.try_normalize() else { continue };
            if !from_sensor.is_finite() || draw(0) >= share {
                continue;
            }
            let [nearest_m, farthest_m] = self.range_m;
            let range_m = nearest_m + (farthest_m - nearest_m) * draw(1);
            scan.positions[i] = self.in_file(direction * range_m);
            *brightness = draw(2) as f32;
            without_surface(&mut scan, i, range_m);
        }
        set_brightness(&mut scan, brightness);
        scan
    }

    /// The scan of a sensor with this part of the rings, evenly spaced, that fires at every
    /// `keep_each`-th azimuth; `None` if the scan has no rings. The shots of a ring are counted in
    /// the order of the file.
    #[must_use]
    pub fn fewer_beams(&self, lasers: f64, keep_each: u32) -> Option<Scan> {
        let rings = self.scan.ring.as_ref()?;
        let mut shots = vec![0u32; usize::from(u16::MAX) + 1];
        let is_kept: Vec<bool> = rings
            .iter()
            .map(|&ring| {
                let shot = &mut shots[usize::from(ring)];
                *shot += 1;
                // Ring r is kept if it raises the number of rings to keep.
                let kept_below = |rings: f64| (rings * lasers + 1e-9).floor();
                let stays = kept_below(f64::from(ring) + 1.0) > kept_below(f64::from(ring));
                stays && (*shot - 1).is_multiple_of(keep_each)
            })
            .collect();
        Some(self.where_point(|i| is_kept[i]))
    }

    fn where_point(&self, is_kept: impl Fn(usize) -> bool) -> Scan {
        let kept: Vec<usize> = (0..self.scan.len()).filter(|&i| is_kept(i)).collect();
        let mut scan = self.scan.select(&kept);
        set_brightness(&mut scan, kept.iter().map(|&i| self.brightness[i]).collect());
        scan
    }

    fn seen_from_sensor(&self, i: usize) -> DVec3 {
        let point = DVec3::from(self.scan.positions[i].map(f64::from));
        DVec3::from_array(self.scan.origin) + point - self.sensor_m
    }

    fn in_file(&self, from_sensor: DVec3) -> [f32; 3] {
        let at = from_sensor + self.sensor_m - DVec3::from_array(self.scan.origin);
        at.as_vec3().to_array()
    }
}

/// Sets the intensities of `scan`, and drops its other attributes of power, which hold for the
/// recorded scan only.
fn set_brightness(scan: &mut Scan, brightness: Vec<f32>) {
    scan.intensity = Some(brightness);
    (scan.power, scan.reflectivity) = (None, None);
}

/// The reflectivity of a ground of reflectivity `rho` under a film of water, at this incidence.
fn wet(rho: f64, cos_incidence: f64) -> f64 {
    let sin_inside = (1.0 - cos_incidence * cos_incidence).max(0.0).sqrt() / WATER;
    let cos_inside = (1.0 - sin_inside * sin_inside).sqrt();
    let reflected = |a: f64, b: f64| ((a - b) / (a + b)).powi(2);
    // The light is unpolarised: the mean of both planes of polarisation.
    let across = reflected(cos_incidence, WATER * cos_inside);
    let along = reflected(WATER * cos_incidence, cos_inside);
    let r = (across + along) / 2.0;
    (1.0 - r).powi(2) / (1.0 - r * rho)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of 8 rings, 100 shots each, on the ground and on a wall 20 m away.
    fn scan() -> Scan {
        let shots = (0..800u16).map(|i| (i % 8, i / 8));
        let at = |(ring, shot): (u16, u16)| {
            let azimuth_rad = f64::from(shot) * 0.01;
            let (sine, cosine) = azimuth_rad.sin_cos();
            let range_m = if ring < 4 { 5.0 + f64::from(ring) } else { 20.0 };
            let z = if ring < 4 { -1.5 } else { f64::from(ring) };
            [(range_m * cosine) as f32, (range_m * sine) as f32, z as f32]
        };
        Scan {
            positions: shots.clone().map(at).collect(),
            ring: Some(shots.clone().map(|(ring, _)| ring).collect()),
            time_s: Some(shots.map(|(_, shot)| f32::from(shot) * 0.001).collect()),
            ..Scan::default()
        }
    }

    fn recorded<'a>(scan: &'a Scan, brightness: &'a [f32], is_ground: &'a [bool]) -> Recorded<'a> {
        let limit = DetectionLimit { reflectivity: 0.1, range_m: 30.0 };
        let (stream, sensor_m) = (StreamKey([1, 2]), DVec3::ZERO);
        let range_m = [0.0, 100.0];
        Recorded { scan, brightness, is_ground, sensor_m, limit, range_m, stream }
    }

    #[test]
    fn water_lets_light_through_as_fresnel_says() {
        // Straight down: r = ((n - 1) / (n + 1))^2, 2.0 % of water.
        let r = ((WATER - 1.0) / (WATER + 1.0)).powi(2);
        assert!((r - 0.0200).abs() < 1e-4);
        assert!((wet(0.2, 1.0) - (1.0 - r).powi(2) / (1.0 - 0.2 * r)).abs() < 1e-12);
        // 60 degrees: Hecht's formulas in their other form, sines and tangents of the angles.
        let (a, b) = (60f64.to_radians(), (60f64.to_radians().sin() / WATER).asin());
        let s = ((a - b).sin() / (a + b).sin()).powi(2);
        let p = ((a - b).tan() / (a + b).tan()).powi(2);
        let t = 1.0 - (s + p) / 2.0;
        assert!((wet(0.0, a.cos()) - t * t).abs() < 1e-12);
        // Along the ground nothing gets in.
        assert!(wet(0.5, 0.0) < 1e-12);
    }

    #[test]
    fn wet_ground_dims_the_ground_alone_and_a_dry_one_not_at_all() {
        let scan = scan();
        let is_ground: Vec<bool> = scan.positions.iter().map(|point| point[2] < 0.0).collect();
        let bright = vec![0.4; scan.len()];
        let at = recorded(&scan, &bright, &is_ground);
        assert_eq!(at.wet_ground(0.0).positions, scan.positions);
        assert_eq!(at.too_weak_before(), 0);
        // Points that lose no power stay, even below the limit.
        let black = vec![1e-6; scan.len()];
        let black = recorded(&scan, &black, &is_ground);
        assert_eq!((black.dirty_window(1.0).len(), black.too_weak_before()), (800, 800));
        let wet = at.wet_ground(1.0);
        let intensity = wet.intensity.as_ref().unwrap();
        for (point, &left) in wet.positions.iter().zip(intensity) {
            assert!(if point[2] < 0.0 { left < 0.37 } else { left == 0.4 }, "{point:?}: {left}");
        }
        // Points at the limit are lost.
        let dim = vec![0.0033; scan.len()];
        let lost = recorded(&scan, &dim, &is_ground).wet_ground(1.0).len();
        assert!(lost < recorded(&scan, &dim, &is_ground).wet_ground(0.0).len());
    }

    #[test]
    fn a_dirty_window_loses_what_is_below_the_limit_when_light_crossed_it_twice() {
        let scan = scan();
        // 0.1 at 30 m is 0.0444 at 20 m: above a quarter of 0.15, below a quarter of 0.2.
        let brightness: Vec<f32> = (0..scan.len()).map(|i| [0.15, 0.2][i / 8 % 2]).collect();
        let is_ground = vec![false; scan.len()];
        let kept = recorded(&scan, &brightness, &is_ground).dirty_window(0.5);
        let far = kept.positions.iter().zip(kept.intensity.as_ref().unwrap());
        let far: Vec<f32> = far.filter(|(p, _)| p[2] == 4.0).map(|(_, left)| *left).collect();
        assert!(far.len() == 50 && far.iter().all(|left| *left == 0.05), "{far:?}");
    }

    #[test]
    fn motion_puts_points_where_a_sensor_on_an_arc_sees_them() {
        let scan = scan();
        let (brightness, is_ground) = (vec![1.0; scan.len()], vec![false; scan.len()]);
        let at = recorded(&scan, &brightness, &is_ground);
        assert_eq!(at.motion(0.0, 0.0).unwrap().positions, scan.positions);
        let moved = at.motion(10.0, 30.0).unwrap();
        // By small steps: forward where it looks, and a little to the left.
        let (mut pose, mut heading, mut time_s) = (DVec3::ZERO, 0.0f64, 0.0);
        let step_s = 1e-6;
        for i in (0..scan.len()).step_by(8) {
            let until_s = f64::from(scan.time_s.as_ref().unwrap()[i]);
            while time_s < until_s - step_s / 2.0 {
                pose += DVec3::new(heading.cos(), heading.sin(), 0.0) * 10.0 * step_s;
                heading += 30f64.to_radians() * step_s;
                time_s += step_s;
            }
            let point = DVec3::from(scan.positions[i].map(f64::from));
            let expected = DQuat::from_rotation_z(-heading) * (point - pose);
            let found = DVec3::from(moved.positions[i].map(f64::from));
            assert!(found.distance(expected) < 1e-5, "{found} {expected}");
        }
        assert!(recorded(&Scan::default(), &[], &[]).motion(1.0, 0.0).is_none());
    }

    #[test]
    fn beams_are_missing_as_many_as_asked_and_fewer_beams_are_even() {
        let scan = scan();
        let (brightness, is_ground) = (vec![1.0; scan.len()], vec![false; scan.len()]);
        let at = recorded(&scan, &brightness, &is_ground);
        for (share, left) in [(0.0, 8), (0.25, 6), (0.5, 4), (1.0, 0)] {
            assert_eq!(at.beams_missing(share).unwrap().len(), 100 * left, "{share}");
        }
        let half = at.fewer_beams(0.5, 2).unwrap();
        assert_eq!(half.len(), 4 * 50);
        assert!(half.ring.unwrap().iter().all(|ring| ring % 2 == 1));
        assert_eq!(at.fewer_beams(1.0, 1).unwrap().positions, scan.positions);
        assert!(at.fewer_beams(0.0, 1).unwrap().is_empty());
    }

    #[test]
    fn crosstalk_is_anywhere_along_the_beam_as_often_as_asked() {
        let scan = scan();
        let (brightness, is_ground) = (vec![0.5; scan.len()], vec![false; scan.len()]);
        let foreign = recorded(&scan, &brightness, &is_ground).crosstalk(0.25);
        let pairs = scan.positions.iter().zip(&foreign.positions).filter(|(a, b)| a != b);
        let ranges: Vec<f64> = pairs
            .map(|(a, b)| {
                let [a, b] = [a, b].map(|point| DVec3::from(point.map(f64::from)));
                assert!(a.normalize().distance(b.normalize()) < 1e-5 || b.length() < 1e-3);
                b.length()
            })
            .collect();
        // Of 800, 200 with a standard deviation of 12; the mean of 200 of 0 to 100 m is off by 2.
        assert!(ranges.len().abs_diff(200) < 50, "{}", ranges.len());
        let mean = ranges.iter().sum::<f64>() / ranges.len() as f64;
        assert!((mean - 50.0).abs() < 8.5, "{mean}");
    }

    #[test]
    fn senseless_settings_fail() {
        for (corruption, expected) in [
            (Corruption::WetGround { film_m: f64::NAN }, "x.film_m"),
            (Corruption::BeamsMissing { share: 1.5 }, "x.share: expected a number within 0..=1"),
            (Corruption::DirtyWindow { transmission: -0.1 }, "x.transmission"),
            (Corruption::FewerBeams { lasers: 0.5, keep_each: 0 }, "x.keep_each"),
            (Corruption::Motion { speed_m_s: 1e9, yaw_rate_deg_s: 0.0 }, "x.speed_m_s"),
        ] {
            let error = corruption.validate("x").unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
