//! From what the rays of a beam hit to the points that the sensor measures.

use super::assemble::{ObjectHits, Tally};
use super::echo::{Echo, Signal, Source, merge, told};
use super::hit_effects::HitEffects;
use super::normals::Normals;
use super::power;
use super::request::ScanRequest;
use crate::config::InvalidValue;
use crate::cpu::random::random_bits;
use crate::effects::{DetectionLimit, Effects, NoiseModel};
use crate::pose::Pose;
use crate::resolve::Hit;
use crate::weather::{Air, AirBeam, Scattered};
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
    /// What is in the air, where anything is.
    pub air: Option<Air>,
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
        let air = effects.weather.as_ref().filter(|weather| !weather.is_clear());
        let air = air.zip(limit).map(|(weather, limit)| {
            let own = || request.sensor.beam_divergence_deg();
            let asked = effects.footprint.and_then(|footprint| footprint.divergence_deg);
            let divergence_deg = asked.unwrap_or_else(own);
            Air::new(weather, divergence_deg, &limit, &request.sensor.range)
        });
        Ok(Self { request, cast_effects, effects, limit, weighs, share, air })
    }

    /// Whether every beam has at most one echo, and every echo is detected.
    pub fn has_one_echo_a_beam(&self) -> bool {
        self.share.is_none() && self.air.is_none() && self.limit.is_none()
    }

    /// How far apart two surfaces, or what is in the air, give two echoes, metres.
    fn separation_m(&self) -> f64 {
        let asked = self.effects.footprint.and_then(|footprint| footprint.separation_m);
        let own = || self.request.sensor.footprint.map(|shape| shape.separation_m);
        asked.or_else(own).unwrap_or_default()
    }

    /// Where a ray points, in world axes.
    fn direction(&self, ray: u32) -> DVec3 {
        self.request.pose_at(ray).world_from_sensor * self.request.pattern.directions[ray as usize]
    }

    /// The ray in the middle of the beam that a ray belongs to.
    fn centre(&self, ray: u32) -> u32 {
        let pattern = self.request.pattern;
        pattern.beam_of(ray) * pattern.rays_per_beam
    }

    /// Whether there is light along a ray: beside the middle of a beam only where beams have a
    /// width. Other rays were cast for other scans.
    fn is_lit(&self, ray: u32) -> bool {
        self.share.is_some() || ray == self.centre(ray)
    }

    /// Where a ray starts, from the sensor, in world axes; `None` where that is the sensor
    /// itself.
    pub fn start(&self, ray: u32) -> Option<DVec3> {
        let start = self.request.pattern.start(ray)?;
        Some(self.request.pose_at(ray).world_from_sensor * start)
    }

    /// Where a ray starts, in the world.
    fn origin(&self, ray: u32) -> DVec3 {
        self.request.pose_at(ray).position_m + self.start(ray).unwrap_or_default()
    }

    /// Where a point is told to be, from `origin`, metres. The sensor was at `start` when the
    /// scan began.
    pub fn place(&self, start: &Pose, objects: &[ObjectHits], r: &Return, origin: DVec3) -> DVec3 {
        if self.request.motion.is_none() {
            return r.from_sensor + (start.position_m - origin);
        }
        let pose = self.request.pose_at(r.ray(objects));
        if self.request.deskew {
            return r.from_sensor + (pose.position_m - origin);
        }
        let in_sensor = pose.world_from_sensor.inverse() * r.from_sensor;
        start.world_from_sensor * in_sensor + (start.position_m - origin)
    }

    /// How strong what comes back from a hit is.
    fn signal(
        &self,
        object: usize,
        found: &ObjectHits,
        hit: &Hit,
        normals: &mut Normals,
    ) -> Signal {
        let material = found.material(self.request.pattern, hit);
        let cosine = || {
            normals.at(object, found, self.request.pattern, hit).dot(self.direction(hit.beam)).abs()
        };
        let whole = power::brightness(material, cosine);
        let mut brightness = self.share.map_or(whole, |share| whole * share);
        if let Some(air) = &self.air {
            let direction = self.direction(hit.beam);
            brightness *= air.transmission(self.origin(hit.beam), direction, hit.range_m);
        }
        let power = power::received(brightness, hit.range_m);
        Signal { power, brightness, retroreflection: material.retroreflection }
    }
}

/// One point on its way into a scan.
#[derive(Clone, Copy)]
pub(super) struct Return {
    pub source: Source,
    /// The point as measured, from the sensor, in world axes.
    pub from_sensor: DVec3,
    /// As [`Signal::brightness`], where anything asks for it.
    pub brightness: f32,
    /// As [`Scan::power`](formats::Scan::power), likewise.
    pub power: f32,
    /// As [`Scan::reflectivity`](formats::Scan::reflectivity), likewise.
    pub reflectivity: u8,
    /// As [`Scan::return_number`](formats::Scan::return_number).
    pub number: u8,
}

impl Return {
    /// The ray that most of it came back along.
    pub fn ray(&self, objects: &[ObjectHits]) -> u32 {
        match self.source {
            Source::Surface { object, hit } => {
                objects[object as usize].hits.hits[hit as usize].beam
            }
            Source::Air { ray, .. } => ray,
        }
    }
}

/// What the sensor makes of the hit at this place in `objects` and in its hits, where each beam
/// has one echo.
pub(super) fn measure_one(
    view: &View,
    objects: &[ObjectHits],
    at: &(usize, usize),
    normals: &mut Normals,
    tally: &mut Tally,
) -> Option<Return> {
    match hear(view, objects, at, normals) {
        Ok(echo) => point(view, objects, &echo, 0, tally),
        Err(Silence::OtherScans) => None,
        Err(Silence::OutOfRange) => {
            tally.out_of_range += 1;
            None
        }
        Err(Silence::Glass) => {
            tally.dropped += 1;
            None
        }
    }
}

/// Appends to `returns` what the sensor makes of its beams, whose rays hit what stands at the
/// places `nearest` in `objects` and in its hits, ascending.
pub(super) fn measure_all(
    view: &View,
    objects: &[ObjectHits],
    nearest: &[(usize, usize)],
    tally: &mut Tally,
    returns: &mut Vec<Return>,
) {
    let pattern = view.request.pattern;
    let ray_of = |&(object, hit): &(usize, usize)| objects[object].hits.hits[hit].beam;
    let beam_of = |at: &(usize, usize)| pattern.beam_of(ray_of(at));
    let mut room = Room { echoes: Vec::new(), normals: Normals::new(objects) };
    let mut measure = |beam, rays: &[_]| {
        measure_beam(view, objects, beam, rays, &mut room, tally, returns);
    };
    let hears_empty_beams = view.air.as_ref().is_some_and(|air| air.empty_beams);
    let mut next = 0;
    for rays in nearest.chunk_by(|a, b| beam_of(a) == beam_of(b)) {
        let beam = beam_of(&rays[0]);
        if hears_empty_beams {
            (next..beam).for_each(|empty| measure(empty, &[]));
            next = beam + 1;
        } else if !rays.iter().any(|at| view.is_lit(ray_of(at))) {
            continue;
        }
        measure(beam, rays);
    }
    if hears_empty_beams {
        (next..pattern.beam_of(pattern.len() as u32)).for_each(|empty| measure(empty, &[]));
    }
}

/// Appends to `returns` what the sensor makes of one `beam`, of which these `rays` hit
/// something.
fn measure_beam(
    view: &View,
    objects: &[ObjectHits],
    beam: u32,
    rays: &[(usize, usize)],
    room: &mut Room,
    tally: &mut Tally,
    returns: &mut Vec<Return>,
) {
    listen(view, objects, rays, room, tally);
    let echoes = &mut room.echoes;
    if let Some(air) = &view.air {
        listen_to_air(view, air, objects, beam, rays, echoes);
    }
    if echoes.len() > 1 {
        merge(echoes, view.separation_m());
    }
    if let Some((detection, limit)) = view.effects.detection.zip(view.limit) {
        let before = echoes.len();
        echoes.retain(|echo| {
            let (stream, ray) = key(view, objects, echo);
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

/// Room to work in, from beam to beam.
struct Room {
    echoes: Vec<Echo>,
    normals: Normals,
}

/// Fills the `echoes` of `room` with what comes back of a beam from surfaces.
fn listen(
    view: &View,
    objects: &[ObjectHits],
    rays: &[(usize, usize)],
    Room { echoes, normals }: &mut Room,
    tally: &mut Tally,
) {
    echoes.clear();
    let (mut is_out_of_range, mut is_lost) = (false, false);
    for at in rays {
        match hear(view, objects, at, normals) {
            Ok(echo) => echoes.push(echo),
            Err(Silence::OutOfRange) => is_out_of_range = true,
            Err(Silence::Glass) => is_lost = true,
            Err(Silence::OtherScans) => {}
        }
    }
    if echoes.is_empty() {
        tally.dropped += u64::from(is_lost);
        tally.out_of_range += u64::from(is_out_of_range && !is_lost);
    }
}

/// Why a hit has no echo.
enum Silence {
    /// Its ray is beside the middle of its beam, and was cast for a scan of wide beams.
    OtherScans,
    OutOfRange,
    Glass,
}

/// The echo of the hit at this place.
fn hear(
    view: &View,
    objects: &[ObjectHits],
    &(object, hit): &(usize, usize),
    normals: &mut Normals,
) -> Result<Echo, Silence> {
    let found = &objects[object];
    let nearest = &found.hits.hits[hit];
    let limits = &view.request.sensor.range;
    if !view.is_lit(nearest.beam) {
        return Err(Silence::OtherScans);
    }
    if !(limits.min_m..=limits.max_m).contains(&nearest.range_m) {
        return Err(Silence::OutOfRange);
    }
    if is_lost_in_glass(view, found, nearest) {
        return Err(Silence::Glass);
    }
    let signal =
        if view.weighs { view.signal(object, found, nearest, normals) } else { Signal::default() };
    let source = Source::Surface { object: object as u32, hit: hit as u32 };
    Ok(Echo { range_m: nearest.range_m, signal, source })
}

/// Appends to `echoes` what comes back from the air along a beam.
fn listen_to_air(
    view: &View,
    air: &Air,
    objects: &[ObjectHits],
    beam: u32,
    rays: &[(usize, usize)],
    echoes: &mut Vec<Echo>,
) {
    let pattern = view.request.pattern;
    let ray = beam * pattern.rays_per_beam;
    let max_m = view.request.sensor.range.max_m;
    let hit_of = |&(object, hit): &(usize, usize)| &objects[object].hits.hits[hit];
    let hits = || rays.iter().map(hit_of).filter(|hit| view.is_lit(hit.beam));
    // Light passes by the surfaces that only some of the rays meet.
    let n_rays = if view.share.is_some() { pattern.rays_per_beam as usize } else { 1 };
    let is_open = hits().count() < n_rays;
    let farthest_m = hits().map(|hit| hit.range_m).fold(0.0, f64::max);
    let end_m = if is_open { max_m } else { farthest_m.min(max_m) };
    let (origin, direction) = (view.origin(ray), view.direction(ray));
    let in_clear_air = |echo: &Echo| {
        let transmission = air.transmission(origin, direction, echo.range_m);
        if transmission > 0.0 { echo.signal.brightness / transmission } else { 0.0 }
    };
    let brightness =
        if air.asks_for_brightness() { echoes.iter().map(in_clear_air).sum() } else { 0.0 };
    let (stream, number) = (view.request.stream, beam);
    let along = AirBeam { origin, direction, end_m, brightness, stream, number };
    let mut draw = 0;
    air.scatter(&along, |scattered| {
        let Scattered { range_m, power, brightness, medium } = scattered;
        let signal = Signal { power, brightness, retroreflection: 0.0 };
        if range_m >= view.request.sensor.range.min_m {
            echoes.push(Echo { range_m, signal, source: Source::Air { ray, medium, draw } });
        }
        draw += 1;
    });
}

/// What keys the random numbers of an echo: those of the ray that returned most of it.
fn key(view: &View, objects: &[ObjectHits], echo: &Echo) -> (StreamKey, u32) {
    match echo.source {
        Source::Surface { object, hit } => {
            let found = &objects[object as usize];
            (found.job.stream, found.hits.hits[hit as usize].beam)
        }
        Source::Air { ray, draw, .. } => {
            // Each return from the air has a stream of its own, which is no surface's either.
            let StreamKey([a, b]) = view.request.stream;
            (StreamKey([a, b ^ AIR_STREAM.wrapping_mul(draw + 1)]), ray)
        }
    }
}

/// Tells the streams of returns from the air apart: the golden ratio's bits, an odd number.
const AIR_STREAM: u32 = 0x9E37_79B9;

/// The point that a sensor measures of an echo that it detects, number `place` of its beam.
fn point(
    view: &View,
    objects: &[ObjectHits],
    echo: &Echo,
    place: usize,
    tally: &mut Tally,
) -> Option<Return> {
    let Echo { signal, source, .. } = *echo;
    let (stream, ray) = key(view, objects, echo);
    let effects = match source {
        Source::Surface { object, hit } => {
            let (pattern, found) = (view.request.pattern, &objects[object as usize]);
            HitEffects::of(view.cast_effects, pattern, found, hit as usize)
        }
        Source::Air { .. } => HitEffects::of_ray(view.cast_effects, stream, ray),
    };
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
    let (power, brightness) =
        (signal.power.min(f64::from(f32::MAX)) as f32, signal.brightness as f32);
    let reflectivity = power::calibrated(signal.brightness, signal.retroreflection);
    // A beam has 37 rays at most.
    let number = place as u8 + 1;
    Some(Return { source, from_sensor, brightness, power, reflectivity, number })
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
