//! The echoes that the receiver gets of surfaces and of the air, and their strength.

use super::echo::{Echo, Signal, Source};
use super::normals::Normals;
use super::object_hits::{HitId, ObjectHits};
use super::power;
use super::request::ScanRequest;
use crate::config::InvalidValue;
use crate::cpu::random::{Purpose, random_bits};
use crate::effects::Effects;
use crate::resolve::Hit;
use crate::sensor::{BeamPattern, DetectionLimit};
use crate::weather::{Air, AirBeam, Scattered};
use formats::rng::StreamKey;
use formats::scan::Attribute;
use glam::DVec3;

/// A scan request with its effects resolved, and the hits of all objects.
pub(super) struct Receiver<'a> {
    pub request: &'a ScanRequest<'a>,
    pub objects: &'a [ObjectHits<'a>],
    /// The effects that were cast: they give the layout of each hit's outputs.
    pub cast_effects: &'a Effects,
    /// The effects to apply: all that were cast, or some.
    pub effects: Effects,
    /// The sensor's detection limit, if detection is among the effects.
    pub limit: Option<DetectionLimit>,
    pub air: Option<Air>,
    /// The part of a beam's power in each of its rays; `None` for beams without width.
    ray_share: Option<f64>,
    /// Whether any effect or attribute needs the strength of echoes.
    needs_signal: bool,
}

pub(super) enum NoEcho {
    /// The ray is off its beam's axis: it was cast for another scan, whose beams have a width.
    NotLit,
    OutOfRange,
    Glass,
}

impl<'a> Receiver<'a> {
    pub fn new(
        request: &'a ScanRequest<'a>,
        cast_effects: &'a Effects,
        objects: &'a [ObjectHits<'a>],
    ) -> Result<Self, InvalidValue> {
        let effects = request.applied_effects(cast_effects)?;
        let limit = effects.detection.and_then(|detection| detection.limit);
        let rays_per_beam = request.pattern.rays_per_beam;
        let is_wide = effects.footprint.is_some() && rays_per_beam > 1;
        let ray_share = is_wide.then(|| f64::from(rays_per_beam).recip());
        let strengths = [Attribute::Power, Attribute::Reflectivity];
        let needs_signal = limit.is_some()
            || is_wide
            || strengths.iter().any(|strength| request.attributes.contains(strength));
        let weather = effects.weather.as_ref().filter(|weather| !weather.is_clear());
        let air = weather.zip(limit).map(|(weather, limit)| {
            let divergence_deg = effects
                .footprint
                .and_then(|footprint| footprint.divergence_deg)
                .unwrap_or_else(|| request.sensor.beam_divergence_deg());
            Air::new(weather, divergence_deg, &limit, &request.sensor.range)
        });
        Ok(Self { request, objects, cast_effects, effects, limit, air, ray_share, needs_signal })
    }

    pub fn pattern(&self) -> &'a BeamPattern {
        self.request.pattern
    }

    pub fn object(&self, id: HitId) -> &'a ObjectHits<'a> {
        &self.objects[id.object as usize]
    }

    pub fn hit(&self, id: HitId) -> &'a Hit {
        &self.object(id).hits.hits[id.hit as usize]
    }

    /// Whether every beam has at most one echo, and every echo is detected.
    pub fn has_one_echo_per_beam(&self) -> bool {
        self.ray_share.is_none() && self.air.is_none() && self.limit.is_none()
    }

    /// The least distance between two echoes that the receiver resolves, metres.
    pub fn separation_m(&self) -> f64 {
        let footprint = self.effects.footprint;
        let of_sensor = || self.request.sensor.footprint.map(|shape| shape.separation_m);
        footprint.and_then(|f| f.separation_m).or_else(of_sensor).unwrap_or_default()
    }

    /// The unit vector along a ray, in world axes.
    pub fn direction(&self, ray: u32) -> DVec3 {
        self.request.pose_at(ray).rotation * self.pattern().directions[ray as usize]
    }

    /// The axis of the beam that a ray belongs to, in world axes.
    pub fn beam_direction(&self, ray: u32) -> DVec3 {
        self.direction(self.axis_of(ray))
    }

    /// The ray along the axis of the beam that a ray belongs to.
    fn axis_of(&self, ray: u32) -> u32 {
        self.pattern().beam_of(ray) * self.pattern().rays_per_beam
    }

    /// Whether a ray carries light in this scan. Off a beam's axis it does only if this scan's
    /// beams have a width: other rays were cast for other scans.
    #[inline]
    pub fn is_lit(&self, ray: u32) -> bool {
        self.ray_share.is_some() || ray == self.axis_of(ray)
    }

    /// The start of a ray relative to the sensor, in world axes; `None` if it is the sensor.
    #[inline]
    pub fn start(&self, ray: u32) -> Option<DVec3> {
        let start = self.pattern().start(ray)?;
        Some(self.request.pose_at(ray).rotation * start)
    }

    fn origin(&self, ray: u32) -> DVec3 {
        self.request.pose_at(ray).position_m + self.start(ray).unwrap_or_default()
    }

    /// The ray along which most of an echo came back.
    #[inline]
    pub fn ray_of(&self, source: Source) -> u32 {
        match source {
            Source::Surface(id) => self.hit(id).beam,
            Source::Air { ray, .. } => ray,
        }
    }

    #[inline]
    pub fn echo_of_hit(&self, id: HitId, normals: &mut Normals) -> Result<Echo, NoEcho> {
        let hit = self.hit(id);
        let limits = &self.request.sensor.range;
        if !self.is_lit(hit.beam) {
            return Err(NoEcho::NotLit);
        }
        if !(limits.min_m..=limits.max_m).contains(&hit.range_m) {
            return Err(NoEcho::OutOfRange);
        }
        if self.is_lost_in_glass(self.object(id), hit) {
            return Err(NoEcho::Glass);
        }
        let signal = if self.needs_signal { self.signal(id, normals) } else { Signal::default() };
        Ok(Echo { range_m: hit.range_m, signal, source: Source::Surface(id) })
    }

    /// Whether a hit is on glass, and its beam one of those that glass does not return.
    #[inline]
    fn is_lost_in_glass(&self, object: &ObjectHits, hit: &Hit) -> bool {
        let Some(glass) = object.glass.filter(|glass| glass.triangles.contains(&hit.triangle))
        else {
            return false;
        };
        let [bits, ..] = random_bits(object.job.stream, self.axis_of(hit.beam), Purpose::Glass);
        f64::from(bits) >= glass.returned * 2f64.powi(32)
    }

    fn signal(&self, id: HitId, normals: &mut Normals) -> Signal {
        let (object, hit) = (self.object(id), self.hit(id));
        let material = object.material(hit);
        let cosine = || normals.at(id, object, self.pattern()).dot(self.direction(hit.beam)).abs();
        let mut brightness = power::brightness(material, cosine);
        if let Some(share) = self.ray_share {
            brightness *= share;
        }
        if let Some(air) = &self.air {
            let direction = self.direction(hit.beam);
            brightness *= air.transmission(self.origin(hit.beam), direction, hit.range_m);
        }
        let power = power::received(brightness, hit.range_m);
        Signal { power, brightness, retroreflection: material.retroreflection }
    }

    /// Appends the echoes of the air along `beam` to `echoes`, which holds those of its surfaces.
    pub fn add_air_echoes(&self, air: &Air, beam: u32, hits: &[HitId], echoes: &mut Vec<Echo>) {
        let ray = beam * self.pattern().rays_per_beam;
        let (origin, direction) = (self.origin(ray), self.direction(ray));
        let limits = &self.request.sensor.range;
        let lit = || hits.iter().map(|&id| self.hit(id)).filter(|hit| self.is_lit(hit.beam));
        let n_rays =
            if self.ray_share.is_some() { self.pattern().rays_per_beam as usize } else { 1 };
        // A beam goes on behind surfaces that only some of its rays meet.
        let end_m = if lit().count() < n_rays {
            limits.max_m
        } else {
            lit().map(|hit| hit.range_m).fold(0.0, f64::max).min(limits.max_m)
        };
        let stream = self.request.stream;
        let along = AirBeam { origin, direction, end_m, stream, number: beam };
        let mut draw = 0;
        air.scatter(&along, |scattered| {
            let Scattered { range_m, power, brightness, medium } = scattered;
            let signal = Signal { power, brightness, retroreflection: 0.0 };
            if range_m >= limits.min_m {
                echoes.push(Echo { range_m, signal, source: Source::Air { ray, medium, draw } });
            }
            draw += 1;
        });
    }

    /// The stream and the ray of an echo's random numbers: those of the ray that returned most.
    #[inline]
    pub fn random_key(&self, source: Source) -> (StreamKey, u32) {
        match source {
            Source::Surface(id) => (self.object(id).job.stream, self.hit(id).beam),
            Source::Air { ray, draw, .. } => {
                // A stream of its own for each echo of the air, different from all surfaces'.
                let StreamKey([a, b]) = self.request.stream;
                (StreamKey([a, b ^ AIR_STREAM.wrapping_mul(draw + 1)]), ray)
            }
        }
    }
}

/// Separates the streams of echoes of the air: the golden ratio's bits, an odd number.
const AIR_STREAM: u32 = 0x9E37_79B9;
