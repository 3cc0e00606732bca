//! From what the rays of a beam hit to the points that the sensor measures.

use super::assemble::{ObjectHits, Tally};
use super::echo::{Echo, Signal, merge, told};
use super::power;
use super::request::ScanRequest;
use crate::config::InvalidValue;
use crate::cpu::random::random_bits;
use crate::effects::{DetectionLimit, Effects, NoiseModel, RayEffect};
use crate::resolve::{Hit, Hits};
use formats::rng::StreamKey;
use formats::scan::Attribute;
use glam::DVec3;

/// A request, and what its effects come to.
pub(super) struct View<'a> {
    pub request: &'a ScanRequest<'a>,
    /// The effects that were cast: they say what each hit's outputs mean.
    pub cast_effects: &'a Effects,
    /// The effects to apply, a part of those that were cast.
    effects: Effects,
    /// The sensor's detection limit, where detection is among the effects.
    limit: Option<DetectionLimit>,
    /// Whether anything asks how strong an echo is.
    weighs: bool,
    /// The part of a beam's power that each of its rays has, where beams have a width.
    share: Option<f64>,
}

impl<'a> View<'a> {
    pub fn new(
        request: &'a ScanRequest<'a>,
        cast_effects: &'a Effects,
    ) -> Result<Self, InvalidValue> {
        let effects = request.applied_effects(cast_effects)?;
        let limit = effects.detection.and_then(|detection| detection.limit);
        let rays_per_beam = request.pattern.rays_per_beam;
        let is_wide = effects.footprint.is_some() && rays_per_beam > 1;
        let share = is_wide.then(|| f64::from(rays_per_beam).recip());
        let reported = [Attribute::Power, Attribute::Reflectivity];
        let reports = reported.iter().any(|of| request.attributes.contains(of));
        let weighs = limit.is_some() || is_wide || reports;
        Ok(Self { request, cast_effects, effects, limit, weighs, share })
    }

    /// Where a ray points, in world axes.
    fn direction(&self, ray: u32) -> DVec3 {
        self.request.pose.world_from_sensor * self.request.pattern.directions[ray as usize]
    }

    /// The ray in the middle of the beam that a ray belongs to.
    fn centre(&self, ray: u32) -> u32 {
        let pattern = self.request.pattern;
        pattern.beam_of(ray) * pattern.rays_per_beam
    }

    /// Where a ray starts, from the sensor, in world axes; `None` where that is the sensor
    /// itself.
    pub fn start(&self, ray: u32) -> Option<DVec3> {
        let start = self.request.pattern.start(ray)?;
        Some(self.request.pose.world_from_sensor * start)
    }

    /// How strong what comes back from a hit is.
    fn signal(&self, found: &ObjectHits, hit: &Hit) -> Signal {
        let material = found.material(self.request.pattern, hit);
        let whole = power::brightness(found, material, hit, self.direction(hit.beam));
        let brightness = self.share.map_or(whole, |share| whole * share);
        let power = power::received(brightness, hit.range_m);
        Signal { power, brightness, retroreflection: material.retroreflection }
    }
}

/// One point on its way into a scan.
#[derive(Clone, Copy)]
pub(super) struct Return {
    pub object: usize,
    pub hit: usize,
    /// The point as measured, from the sensor, in world axes.
    pub from_sensor: DVec3,
    /// As [`Scan::power`](formats::Scan::power), where anything asks for it.
    pub power: f32,
    /// As [`Scan::reflectivity`](formats::Scan::reflectivity), likewise.
    pub reflectivity: u8,
    /// As [`Scan::return_number`](formats::Scan::return_number).
    pub number: u8,
}

/// Appends to `returns` what the sensor makes of the hits of one beam's `rays`, which are places
/// in `objects` and in its hits, at least one. `echoes` is room to work in.
pub(super) fn measure(
    view: &View,
    objects: &[ObjectHits],
    rays: &[(usize, usize)],
    echoes: &mut Vec<Echo>,
    tally: &mut Tally,
    returns: &mut Vec<Return>,
) {
    listen(view, objects, rays, echoes, tally);
    if let (Some(footprint), 2..) = (view.effects.footprint, echoes.len()) {
        merge(echoes, footprint.separation_m.unwrap_or_default());
    }
    if let Some((detection, limit)) = view.effects.detection.zip(view.limit) {
        let before = echoes.len();
        echoes.retain(|echo| {
            let (stream, ray) = key(objects, echo);
            power::is_detected(&detection, &limit, echo.signal.power, stream, ray)
        });
        tally.undetected += (before - echoes.len()) as u64;
    }
    if echoes.is_empty() {
        return;
    }
    let (one, other) = told(echoes, view.effects.returns.unwrap_or_default());
    for place in [Some(one), other].into_iter().flatten() {
        returns.extend(point(view, objects, &echoes[place], place, tally));
    }
}

/// Fills `echoes` with what comes back of a beam.
fn listen(
    view: &View,
    objects: &[ObjectHits],
    rays: &[(usize, usize)],
    echoes: &mut Vec<Echo>,
    tally: &mut Tally,
) {
    echoes.clear();
    let limits = &view.request.sensor.range;
    let (mut is_out_of_range, mut is_lost) = (false, false);
    for &(object, hit) in rays {
        let found = &objects[object];
        let nearest = &found.hits.hits[hit];
        if view.share.is_none() && nearest.beam != view.centre(nearest.beam) {
            // The rays around it were cast for a scan of wide beams.
            continue;
        }
        if !(limits.min_m..=limits.max_m).contains(&nearest.range_m) {
            is_out_of_range = true;
        } else if is_lost_in_glass(view, found, nearest) {
            is_lost = true;
        } else {
            let signal = if view.weighs { view.signal(found, nearest) } else { Signal::default() };
            echoes.push(Echo { range_m: nearest.range_m, signal, object, hit });
        }
    }
    if echoes.is_empty() {
        tally.dropped += u64::from(is_lost);
        tally.out_of_range += u64::from(is_out_of_range && !is_lost);
    }
}

/// What keys the random numbers of an echo: those of the ray that returned most of it.
fn key(objects: &[ObjectHits], echo: &Echo) -> (StreamKey, u32) {
    let found = &objects[echo.object];
    (found.job.stream, found.hits.hits[echo.hit].beam)
}

/// The point that a sensor measures of an echo that it detects, number `place` of its beam.
fn point(
    view: &View,
    objects: &[ObjectHits],
    echo: &Echo,
    place: usize,
    tally: &mut Tally,
) -> Option<Return> {
    let Echo { object, hit, signal, .. } = *echo;
    let (stream, ray) = key(objects, echo);
    let effects = HitEffects::of(view.cast_effects, objects[object].hits, hit);
    if view.effects.dropout.is_some() && effects.dropped {
        tally.dropped += 1;
        return None;
    }
    let noise = view.effects.noise.map(|noise| noise.model);
    let along = if noise == Some(NoiseModel::Range) { effects.noise.x } else { 0.0 };
    let sigma_m = view.effects.detection.and_then(|detection| detection.range_sigma_m);
    let timing_m = sigma_m.zip(view.limit).map_or(0.0, |(sigma_m, limit)| {
        power::range_error(sigma_m, &limit, signal.power, stream, ray)
    });
    let mut range_m = echo.range_m + along + timing_m;
    if let Some(step_m) = view.effects.quantum.and_then(|quantum| quantum.step_m) {
        range_m = (range_m / step_m).round() * step_m;
    }
    if range_m <= 0.0 {
        tally.negative += 1;
        return None;
    }
    let sideways = if noise == Some(NoiseModel::Xyz) { effects.noise } else { DVec3::ZERO };
    let from_start = view.direction(view.centre(ray)) * range_m + sideways;
    let from_sensor = view.start(ray).map_or(from_start, |start| from_start + start);
    let power = signal.power.min(f64::from(f32::MAX)) as f32;
    let reflectivity = power::calibrated(signal.brightness, signal.retroreflection);
    // A beam has 37 rays at most.
    let number = place as u8 + 1;
    Some(Return { object, hit, from_sensor, power, reflectivity, number })
}

/// Which random bits of a beam say whether glass returns it; effects use lower
/// numbers.
const GLASS_PURPOSE: u32 = 16;

/// Whether a hit is of glass, and its beam one of those that glass does not return.
fn is_lost_in_glass(view: &View, found: &ObjectHits, hit: &Hit) -> bool {
    let Some(glass) = found.glass.filter(|glass| glass.triangles.contains(&hit.triangle)) else {
        return false;
    };
    let [bits, ..] = random_bits(found.job.stream, view.centre(hit.beam), GLASS_PURPOSE);
    f64::from(bits) >= glass.returned * 2f64.powi(32)
}

/// What the effects say of one hit.
#[derive(Default)]
pub(super) struct HitEffects {
    /// Along the ray in x where the noise is of the range.
    noise: DVec3,
    dropped: bool,
    pub intensity: f32,
}

impl HitEffects {
    /// Reads the outputs of `cast_effects` for number `hit` of `hits`.
    pub fn of(cast_effects: &Effects, hits: &Hits, hit: usize) -> Self {
        let per_hit = cast_effects.outputs_per_ray();
        let mut outputs = &hits.effect_outputs[hit * per_hit..(hit + 1) * per_hit];
        let mut found = Self::default();
        for effect in cast_effects.per_ray() {
            let (own, others) = outputs.split_at(effect.width());
            outputs = others;
            match effect {
                RayEffect::NoiseRange(_) => found.noise.x = own[0].into(),
                RayEffect::NoiseXyz(_) => {
                    found.noise = DVec3::new(own[0].into(), own[1].into(), own[2].into());
                }
                RayEffect::Dropout(_) => found.dropped = own[0] != 0.0,
                RayEffect::Intensity => found.intensity = own[0],
            }
        }
        found
    }
}
