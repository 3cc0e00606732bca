//! The effect of the air on a beam: it attenuates returns, and scatters light back itself.
//!
//! All powers are relative to that of a white surface that faces the sensor 1 m away in clear
//! air. A surface of brightness b (its reflectivity times the cosine of the incidence) at range
//! R returns
//!
//! ```text
//! P = b exp(-2 a R) / R^2
//! ```
//!
//! with a, the extinction per metre, the sum over everything in the air. Returns of rain, snow, fog
//! and dust have the same units, so that one threshold decides which returns are detected, and
//! which is the strongest.
//!
//! # Rain and snow
//!
//! Drops have exponentially distributed diameters D, `N(D) = N0 exp(-L D)`: for rain Marshall and
//! Palmer's of 1948, for snow Gunn and Marshall's of 1958, with the constants of LISA (Kilic et
//! al., arXiv 2107.07004), whose N0 of snow is twice theirs. A drop of diameter D at range r, in
//! a beam of width w(r), returns
//!
//! ```text
//! P = F exp(-2 a r) min(D^2 / w^2, 1) / r^2,    F = ((n - 1) / (n + 1))^2
//! ```
//!
//! with n the index of refraction. The extinction of rain and snow is a power law fitted to
//! LISA's integrals of Mie's theory, within 0.3 % (0.5 to 100 mm/h) and 0.5 % (0.5 to 10 mm/h).
//!
//! LISA draws all drops in a beam, some ten thousand, and takes the strongest. Only a few of them,
//! near the sensor, are strong enough to be detected. Their number has a Poisson distribution whose
//! mean is an integral along the beam, so that this module draws those alone. LISA includes the
//! cosine of the incidence in the reflectivity of surfaces.
//!
//! # Fog
//!
//! A pulse `sin^2(pi t / 2 T)` of duration 2 T returns from all of the fog that it has passed:
//!
//! ```text
//! I(R) = integral of sin^2(pi t / 2 T) exp(-2 a r) x(r) / r^2 dt,    r = R - c t / 2
//! ```
//!
//! with x(r) the part of the beam that the receiver sees, 0 up to 0.9 m and 1 from 1 m (Rasshofer
//! et al., Adv. Radio Sci. 9, 2011; Hahner et al., ICCV 2021). The maximum, at about 4.6 m, is the
//! return of the fog. Its power is `pi (c / 2) beta I`, with `beta = 0.046 / visibility` the
//! backscatter per metre and steradian. By the same formula the return of a surface peaks
//! `c T / 2 = 3 m` behind it, and sensors correct for that: they report fog about 1.6 m away. A
//! surface nearer than 4.6 m removes the fog behind it.
//!
//! # Haze
//!
//! Kruse's law: `a = 3.912 / V (wavelength / 550 nm)^-q` per kilometre, with V the visibility in
//! kilometres, and q 1.6 above 50 km, 1.3 from 6 km to 50 km, and 0.585 times the cube root of V
//! below. The wavelength is 905 nm.
//!
//! # Dust and spray
//!
//! A box with the extinction of fog. As in MAVS (Goodin et al.), a beam returns from inside with
//! probability d / 0.7, where d is the box's optical depth along the beam. The depth of the return
//! follows from the extinction, and its power is that of the part of the box within a pulse's
//! length L behind it:
//!
//! ```text
//! brightness = pi beta (1 - exp(-2 a L)) / (2 a)
//! ```
//!
//! times the transmission up to it: at most pi beta / (2 a) = 0.024, that of endless fog.

mod drops;
mod fog;
mod recorded;

pub(crate) use recorded::without_surface;
pub use recorded::{Fates, in_weather};

use crate::cpu::random::{Purpose, random_bits};
use crate::effects::{Volume, Weather};
use crate::sensor::{DetectionLimit, RangeLimits};
use drops::Drops;
use fog::{Fog, extinction_of};
use formats::rng::StreamKey;
use glam::DVec3;

formats::named! {
    /// The medium that returned a point.
    #[derive(Default)]
    pub enum Medium: "medium" {
        /// A surface.
        #[default]
        Surface = "surface",
        /// A drop of rain.
        Rain = "rain",
        /// A flake of snow.
        Snow = "snow",
        /// Fog.
        Fog = "fog",
        /// Dust or spray.
        Dust = "dust",
    }
}

/// The air of one scan.
#[derive(Clone, Debug)]
pub struct Air {
    /// The extinction of everything but the volumes, per metre.
    extinction: f64,
    rain: Option<Drops>,
    snow: Option<Drops>,
    fog: Option<Fog>,
    volumes: Vec<Volume>,
    /// Whether beams that meet no surface may return from the air.
    pub empty_beams: bool,
}

/// A beam through the air.
#[derive(Clone, Copy, Debug)]
pub struct AirBeam {
    /// Its start in the world, metres.
    pub origin: DVec3,
    /// Its unit direction in the world.
    pub direction: DVec3,
    /// Its length, metres: up to the farthest surface that it meets, or the sensor's limit.
    pub end_m: f64,
    /// The stream of its random numbers.
    pub stream: StreamKey,
    /// Its number, which keys its random numbers in the stream.
    pub number: u32,
}

/// A return of the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattered {
    /// Its range, metres.
    pub range_m: f64,
    /// Its power.
    pub power: f64,
    /// The brightness of a surface of the same power at this range.
    pub brightness: f64,
    /// Its medium.
    pub medium: Medium,
}

/// The wavelength that the constants are for, 905 nm, in units of 550 nm.
const WAVELENGTH: f64 = 905.0 / 550.0;

impl Air {
    /// The air of this `weather`, for a sensor whose beams diverge by these angles, degrees.
    #[must_use]
    pub fn new(
        weather: &Weather,
        divergence_deg: [f64; 2],
        limit: &DetectionLimit,
        range: &RangeLimits,
    ) -> Self {
        let of_rate = |rate: Option<f64>| rate.filter(|&rate| rate > 0.0);
        let (rain_mm_h, snow_mm_h) = (of_rate(weather.rain_mm_h), of_rate(weather.snow_mm_h));
        let extinction = rain_mm_h.map_or(0.0, drops::rain_extinction)
            + snow_mm_h.map_or(0.0, drops::snow_extinction)
            + weather.fog_visibility_m.map_or(0.0, extinction_of)
            + weather.haze_visibility_m.map_or(0.0, haze_extinction);
        let width =
            divergence_deg.map(|deg| libm::tan(deg.to_radians())).iter().product::<f64>().sqrt();
        let beam = drops::Beam { width, extinction, least_power: limit.power(), range: *range };
        Self {
            extinction,
            rain: rain_mm_h.map(|rate| Drops::rain(rate, &beam)),
            snow: snow_mm_h.map(|rate| Drops::snow(rate, &beam)),
            fog: weather.fog_visibility_m.map(|visibility_m| Fog::new(visibility_m, extinction)),
            volumes: weather.volumes.clone(),
            empty_beams: weather.empty_beams.unwrap_or(true),
        }
    }

    /// The part of the light that is transmitted to this range and back.
    #[must_use]
    pub fn transmission(&self, origin: DVec3, direction: DVec3, range_m: f64) -> f64 {
        let in_volumes = self.depth_in_volumes(origin, direction, range_m);
        libm::exp(-2.0 * (self.extinction * range_m + in_volumes))
    }

    /// The optical depth of the volumes along a beam up to this range.
    fn depth_in_volumes(&self, origin: DVec3, direction: DVec3, range_m: f64) -> f64 {
        self.volumes.iter().map(|volume| depth(volume, origin, direction, range_m)).sum()
    }

    /// Passes the returns of the air along `beam` to `take`, unordered.
    pub fn scatter(&self, beam: &AirBeam, mut take: impl FnMut(Scattered)) {
        let AirBeam { origin, direction, end_m, stream, number, .. } = *beam;
        // Drops and fog are drawn without the volumes, which then attenuate them.
        let behind_volumes = |one: Scattered| {
            if self.volumes.is_empty() {
                return one;
            }
            let left = libm::exp(-2.0 * self.depth_in_volumes(origin, direction, one.range_m));
            Scattered { power: one.power * left, brightness: one.brightness * left, ..one }
        };
        let mut drops_of = |drops: &Option<Drops>, purpose: fn(u32) -> Purpose, medium| {
            if let Some(drops) = drops {
                let bits = |draw| random_bits(stream, number, purpose(draw));
                drops.draw(end_m, bits, |range_m, power| {
                    let brightness = power * range_m.powi(2);
                    take(behind_volumes(Scattered { range_m, power, brightness, medium }));
                });
            }
        };
        drops_of(&self.rain, Purpose::Rain, Medium::Rain);
        drops_of(&self.snow, Purpose::Snow, Medium::Snow);
        if let Some(scattered) = self.fog.and_then(|fog| fog.scattered(beam)) {
            take(behind_volumes(scattered));
        }
        for (volume, i) in self.volumes.iter().zip(0..) {
            if let Some(scattered) = self.scattered_in(volume, beam, Purpose::Dust(i)) {
                take(scattered);
            }
        }
    }

    fn scattered_in(&self, volume: &Volume, beam: &AirBeam, purpose: Purpose) -> Option<Scattered> {
        let AirBeam { origin, direction, end_m, stream, number, .. } = *beam;
        let (enters_m, leaves_m) = inside(volume, origin, direction, end_m)?;
        let extinction = extinction_of(volume.visibility_m);
        let optical_depth = extinction * (leaves_m - enters_m);
        let [event, place, ..] = random_bits(stream, number, purpose);
        // MAVS: dust with an optical depth of 0.7 returns every beam.
        if optical_depth == 0.0 || unit(event) * 0.7 >= optical_depth {
            return None;
        }
        let within = -libm::log1p(unit(place) * libm::expm1(-optical_depth)) / extinction;
        let range_m = enters_m + within.min(leaves_m - enters_m);
        let transmission = self.transmission(origin, direction, range_m);
        let brightness = fog::of_one_pulse(volume.visibility_m, leaves_m - range_m) * transmission;
        let power = brightness / range_m.powi(2);
        let is_something = power > 0.0 && power.is_finite();
        is_something.then_some(Scattered { range_m, power, brightness, medium: Medium::Dust })
    }
}

/// A number in [0, 1) from 32 bits.
fn unit(bits: u32) -> f64 {
    f64::from(bits) * (1.0 / 4_294_967_296.0)
}

fn depth(volume: &Volume, origin: DVec3, direction: DVec3, range_m: f64) -> f64 {
    inside(volume, origin, direction, range_m).map_or(0.0, |(enters_m, leaves_m)| {
        (leaves_m - enters_m) * extinction_of(volume.visibility_m)
    })
}

/// The distances at which a beam enters and leaves `volume`, up to `end_m`.
fn inside(volume: &Volume, origin: DVec3, direction: DVec3, end_m: f64) -> Option<(f64, f64)> {
    let (mut enters_m, mut leaves_m) = (0.0f64, end_m);
    for axis in 0..3 {
        let faces = [volume.min_m[axis], volume.max_m[axis]];
        if direction[axis] == 0.0 {
            // A beam along a face counts as inside.
            if !(faces[0]..=faces[1]).contains(&origin[axis]) {
                return None;
            }
            continue;
        }
        let inverse = direction[axis].recip();
        let [a, b] = faces.map(|m| (m - origin[axis]) * inverse);
        enters_m = enters_m.max(a.min(b));
        leaves_m = leaves_m.min(a.max(b));
    }
    (enters_m < leaves_m).then_some((enters_m, leaves_m))
}

/// The extinction of haze, per metre.
fn haze_extinction(visibility_m: f64) -> f64 {
    let visibility_km = visibility_m / 1000.0;
    let exponent = match visibility_km {
        above if above > 50.0 => 1.6,
        above if above >= 6.0 => 1.3,
        below => 0.585 * libm::cbrt(below),
    };
    3.912 / visibility_m * libm::pow(WAVELENGTH, -exponent)
}

#[cfg(test)]
mod tests;
