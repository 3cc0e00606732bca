//! From hits to the points of a scan: effects, clipping, attributes.

use super::power;
use super::request::{Glass, ScanRequest};
use crate::config::InvalidValue;
use crate::cpu::oracle;
use crate::cpu::random::random_bits;
use crate::effects::{DetectionLimit, Effects, NoiseModel, RayEffect};
use crate::job::CastJob;
use crate::material::{Material, Materials};
use crate::resolve::{Hit, Hits};
use crate::sensor::{BeamPattern, Sensor, polar_angle_rad};
use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::{DAffine3, DVec3};
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// What one object returned.
#[derive(Clone, Copy, Debug)]
pub struct ObjectHits<'a> {
    /// The object's number in its scene.
    pub object: u32,
    /// Where the object stands.
    pub world_from_object: DAffine3,
    /// Which of it is glass.
    pub glass: Option<&'a Glass>,
    /// As [`PlacedTarget::retroreflection`](super::PlacedTarget::retroreflection).
    pub retroreflection: f64,
    /// The materials of its triangles, where they differ.
    pub materials: Option<&'a Materials>,
    /// The rays that were cast at it.
    pub job: &'a CastJob,
    /// What they hit.
    pub hits: &'a Hits,
}

impl ObjectHits<'_> {
    /// What the surface is made of where a beam of `pattern` hit it.
    pub(super) fn material(&self, pattern: &BeamPattern, hit: &Hit) -> Material {
        let (reflectivity, retroreflection) = (self.job.reflectivity.into(), self.retroreflection);
        let one = || Material { reflectivity, retroreflection };
        let barycentric = || {
            let ray = self.job.frame.beam(pattern, hit.beam);
            let surface = &self.job.target.surface;
            surface.barycentric(hit.triangle, ray.origin + hit.range_m * ray.direction)
        };
        self.materials.map_or_else(one, |materials| materials.at(hit.triangle, barycentric))
    }
}

/// What became of a scan's returns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tally {
    /// Points in the scan.
    pub points: u64,
    /// Beams whose nearest surface lies outside the sensor's range.
    pub out_of_range: u64,
    /// Returns lost to dropout or in glass.
    pub dropped: u64,
    /// Returns too weak to be detected.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub undetected: u64,
    /// Returns whose measured range is not positive.
    pub negative: u64,
}

fn is_zero(n: &u64) -> bool {
    *n == 0
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.points += other.points;
        self.out_of_range += other.out_of_range;
        self.dropped += other.dropped;
        self.undetected += other.undetected;
        self.negative += other.negative;
    }
}

/// Beyond this, positions are stored from an origin near the sensor: f32 holds
/// 1 km to 0.06 mm and no better.
const ORIGIN_BEYOND_M: f64 = 1024.0;

/// The scan that `request` asks for over all `objects`, at which a caster of
/// `cast_effects` has cast: for each beam the nearest surface, in the order of
/// firing.
///
/// # Errors
/// As [`ScanRequest::applied_effects`].
pub fn assemble(
    request: &ScanRequest,
    cast_effects: &Effects,
    objects: &[ObjectHits],
) -> Result<(Scan, Tally), InvalidValue> {
    let effects = request.applied_effects(cast_effects)?;
    let limit = effects.detection.and_then(|detection| detection.limit);
    let view = View { request, cast_effects, effects, limit };
    let position_m = request.pose.position_m;
    let origin = origin_for(position_m);
    let mut tally = Tally::default();
    let mut returns: Vec<Return> = nearest_per_beam(objects)
        .filter_map(|(object, hit)| measure(&view, &objects[object], object, hit, &mut tally))
        .collect();
    post_process(request, &mut returns);
    tally.points = returns.len() as u64;
    let scan = Scan {
        origin: origin.to_array(),
        positions: returns.iter().map(|r| f32x3(r.from_sensor + (position_m - origin))).collect(),
        ..Scan::default()
    };
    Ok((with_attributes(scan, &view, objects, &returns), tally))
}

/// A request, and what its effects come to.
struct View<'a> {
    request: &'a ScanRequest<'a>,
    /// The effects that were cast: they say what each hit's outputs mean.
    cast_effects: &'a Effects,
    /// The effects to apply, a part of those that were cast.
    effects: Effects,
    /// The sensor's detection limit, where detection is among the effects.
    limit: Option<DetectionLimit>,
}

impl View<'_> {
    /// Where a beam points, in world axes.
    fn direction(&self, beam: u32) -> DVec3 {
        self.request.pose.world_from_sensor * self.request.pattern.directions[beam as usize]
    }
}

/// Zero near the world's origin, else whole metres near the sensor.
fn origin_for(position_m: DVec3) -> DVec3 {
    if position_m.abs().max_element() < ORIGIN_BEYOND_M { DVec3::ZERO } else { position_m.round() }
}

fn f32x3(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// Places in `objects` and in its hits: one per beam, ascending. Of equal ranges
/// the object that comes first wins.
fn nearest_per_beam(objects: &[ObjectHits]) -> impl Iterator<Item = (usize, usize)> {
    let mut all: Vec<(u32, f64, usize, usize)> = objects
        .iter()
        .enumerate()
        .flat_map(|(object, found)| {
            let hits = found.hits.hits.iter().enumerate();
            hits.map(move |(i, hit)| (hit.beam, hit.range_m, object, i))
        })
        .collect();
    if objects.len() > 1 {
        all.sort_unstable_by(|p, q| {
            p.0.cmp(&q.0).then(p.1.total_cmp(&q.1)).then((p.2, p.3).cmp(&(q.2, q.3)))
        });
        all.dedup_by_key(|entry| entry.0);
    }
    all.into_iter().map(|(_, _, object, i)| (object, i))
}

/// One point on its way into a scan.
#[derive(Clone, Copy)]
struct Return {
    object: usize,
    hit: usize,
    /// The point as measured, from the sensor, in world axes.
    from_sensor: DVec3,
}

/// What the sensor makes of a hit; `None` if it returns nothing.
fn measure(
    view: &View,
    found: &ObjectHits,
    object: usize,
    hit: usize,
    tally: &mut Tally,
) -> Option<Return> {
    let nearest = &found.hits.hits[hit];
    let limits = &view.request.sensor.range;
    if !(limits.min_m..=limits.max_m).contains(&nearest.range_m) {
        tally.out_of_range += 1;
        return None;
    }
    if is_lost_in_glass(found, nearest) {
        tally.dropped += 1;
        return None;
    }
    let beam = view.direction(nearest.beam);
    let Some(timing_m) = detect(view, found, nearest, beam) else {
        tally.undetected += 1;
        return None;
    };
    let effects = HitEffects::of(view.cast_effects, found.hits, hit);
    if view.effects.dropout.is_some() && effects.dropped {
        tally.dropped += 1;
        return None;
    }
    let noise = view.effects.noise.map(|noise| noise.model);
    let along = if noise == Some(NoiseModel::Range) { effects.noise.x } else { 0.0 };
    let mut range_m = nearest.range_m + along + timing_m;
    if let Some(step_m) = view.effects.quantum.and_then(|quantum| quantum.step_m) {
        range_m = (range_m / step_m).round() * step_m;
    }
    if range_m <= 0.0 {
        tally.negative += 1;
        return None;
    }
    let sideways = if noise == Some(NoiseModel::Xyz) { effects.noise } else { DVec3::ZERO };
    let from_start = beam * range_m + sideways;
    let from_sensor = start(view, nearest.beam).map_or(from_start, |start| from_start + start);
    Some(Return { object, hit, from_sensor })
}

/// The error that a receiver's noise gives the range of a hit, metres; `None` if the sensor
/// does not detect it.
fn detect(view: &View, found: &ObjectHits, hit: &Hit, beam: DVec3) -> Option<f64> {
    let Some((detection, limit)) = view.effects.detection.zip(view.limit) else {
        return Some(0.0);
    };
    let material = found.material(view.request.pattern, hit);
    let power = power::received(power::brightness(found, material, hit, beam), hit.range_m);
    let stream = found.job.stream;
    let error = |sigma_m| power::range_error(sigma_m, &limit, power, stream, hit.beam);
    power::is_detected(&detection, &limit, power, stream, hit.beam)
        .then(|| detection.range_sigma_m.map_or(0.0, error))
}

/// Which random bits of a beam say whether glass returns it; effects use lower
/// numbers.
const GLASS_PURPOSE: u32 = 16;

fn is_lost_in_glass(found: &ObjectHits, hit: &Hit) -> bool {
    let Some(glass) = found.glass.filter(|glass| glass.triangles.contains(&hit.triangle)) else {
        return false;
    };
    let [bits, ..] = random_bits(found.job.stream, hit.beam, GLASS_PURPOSE);
    f64::from(bits) >= glass.returned * 2f64.powi(32)
}

/// Where a beam starts, from the sensor, in world axes; `None` where that is
/// the sensor itself.
fn start(view: &View, beam: u32) -> Option<DVec3> {
    view.request.pattern.start(beam).map(|start| view.request.pose.world_from_sensor * start)
}

/// What the effects say of one hit.
#[derive(Default)]
struct HitEffects {
    /// Along the ray in x where the noise is of the range.
    noise: DVec3,
    dropped: bool,
    intensity: f32,
}

impl HitEffects {
    /// Reads the outputs of `cast_effects` for number `hit` of `hits`.
    fn of(cast_effects: &Effects, hits: &Hits, hit: usize) -> Self {
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

/// The rings and the drawing of points that a sensor's profile may ask for.
fn post_process(request: &ScanRequest, returns: &mut Vec<Return>) {
    let Sensor { rings, sample, .. } = request.sensor;
    if let (Some(sample), Some(_)) = (sample, rings) {
        let drawn = sample.draw_before_rings(returns.len() as u32, request.stream);
        *returns = drawn.iter().map(|&i| returns[i as usize]).collect();
    }
    if let Some(rings) = rings {
        let polar = |r: &Return| polar_angle_rad(r.from_sensor);
        let first_rad = returns.iter().map(polar).fold(f64::INFINITY, f64::min);
        returns.retain_mut(|r| {
            let range_m = r.from_sensor.length();
            let snapped = rings.snap_to_ring(r.from_sensor / range_m, first_rad);
            r.from_sensor = snapped.unwrap_or_default() * range_m;
            snapped.is_some()
        });
    }
    if let Some(sample) = sample {
        let [low, high] = request.stream.0;
        let drawn = sample.draw(returns.len() as u32, StreamKey([!low, high]));
        *returns = drawn.iter().map(|&i| returns[i as usize]).collect();
    }
}

fn with_attributes(
    mut scan: Scan,
    view: &View,
    objects: &[ObjectHits],
    returns: &[Return],
) -> Scan {
    let hit = |r: &Return| &objects[r.object].hits.hits[r.hit];
    let beam = |r: &Return| hit(r).beam as usize;
    let from_start =
        |r: &Return| start(view, hit(r).beam).map_or(r.from_sensor, |start| r.from_sensor - start);
    for attribute in &view.request.attributes {
        match attribute {
            Attribute::Range => {
                scan.range_m = column(returns, |r| from_start(r).length() as f32);
            }
            Attribute::Beam => scan.beam = column(returns, |r| hit(r).beam),
            Attribute::Ring => scan.ring = column(returns, |r| view.request.pattern.ring[beam(r)]),
            Attribute::Time => {
                scan.time_s = column(returns, |r| view.request.pattern.time_s[beam(r)] as f32);
            }
            Attribute::Triangle => scan.triangle = column(returns, |r| hit(r).triangle),
            Attribute::Object => scan.object = column(returns, |r| objects[r.object].object),
            Attribute::Intensity => {
                scan.intensity = column(returns, |r| {
                    let found = &objects[r.object];
                    let intensity = HitEffects::of(view.cast_effects, found.hits, r.hit).intensity;
                    let own = found.materials.map(|_| found.material(view.request.pattern, hit(r)));
                    own.map_or(intensity, |own| intensity * own.reflectivity as f32)
                });
            }
            Attribute::Power => {
                scan.power = column(returns, |r| {
                    let (found, hit) = (&objects[r.object], hit(r));
                    let material = found.material(view.request.pattern, hit);
                    let beam = view.direction(hit.beam);
                    let brightness = power::brightness(found, material, hit, beam);
                    power::received(brightness, hit.range_m).min(f64::from(f32::MAX)) as f32
                });
            }
            Attribute::Reflectivity => {
                scan.reflectivity = column(returns, |r| {
                    let (found, hit) = (&objects[r.object], hit(r));
                    let material = found.material(view.request.pattern, hit);
                    power::calibrated(found, material, hit, view.direction(hit.beam))
                });
            }
            Attribute::Normal => {
                scan.normal =
                    column(returns, |r| normal(&objects[r.object], hit(r).triangle, from_start(r)));
            }
        }
    }
    scan
}

fn column<T>(returns: &[Return], value: impl Fn(&Return) -> T) -> Option<Vec<T>> {
    Some(returns.iter().map(value).collect())
}

/// A unit normal of the surface in world axes; zero for a triangle without area.
pub(super) fn unit_normal(found: &ObjectHits, triangle: u32) -> DVec3 {
    let in_object = oracle::normal(&found.job.target, triangle);
    (found.world_from_object.matrix3.inverse().transpose() * in_object).normalize_or_zero()
}

/// The surface's unit normal in world axes, against the `beam` that hit it.
fn normal(found: &ObjectHits, triangle: u32, beam: DVec3) -> [f32; 3] {
    let normal = unit_normal(found, triangle);
    f32x3(if normal.dot(beam) > 0.0 { -normal } else { normal })
}
