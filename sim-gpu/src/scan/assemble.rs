//! From hits to the points of a scan: effects, clipping, attributes.

use super::echo::Source;
use super::hit_effects::HitEffects;
use super::measure::{Return, View, measure_all, measure_one};
use super::normals::{Normals, unit_normal};
use super::request::{Glass, ScanRequest};
use crate::config::InvalidValue;
use crate::effects::Effects;
use crate::job::CastJob;
use crate::material::{Material, Materials};
use crate::motion::Motion;
use crate::resolve::{Hit, Hits};
use crate::sensor::{BeamPattern, Sensor, polar_angle_rad};
use crate::weather::Medium;
use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::{DAffine3, DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// What one object returned.
#[derive(Clone, Copy, Debug)]
pub struct ObjectHits<'a> {
    /// The object's number in its scene.
    pub object: u32,
    /// Where the object stands, if it does not move.
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

impl<'a> ObjectHits<'a> {
    /// What the only object returned, which stands in the world as its mesh does.
    #[must_use]
    pub fn alone(job: &'a CastJob, hits: &'a Hits, materials: Option<&'a Materials>) -> Self {
        let world_from_object = DAffine3::IDENTITY;
        let (object, retroreflection, glass) = (0, 0.0, None);
        Self { object, world_from_object, glass, retroreflection, materials, job, hits }
    }

    /// Where the object is when `ray` of `pattern` is fired.
    pub(super) fn world_from_object_at(&self, pattern: &BeamPattern, ray: u32) -> DAffine3 {
        let at = |motion: &Motion| motion.world_from_object_at(pattern.time_s[ray as usize]);
        self.job.motion.as_ref().map_or(self.world_from_object, at)
    }

    /// Whether its normals change from beam to beam.
    pub(super) fn turns(&self) -> bool {
        self.job.motion.is_some()
    }

    /// What the surface is made of where a beam of `pattern` hit it.
    pub(super) fn material(&self, pattern: &BeamPattern, hit: &Hit) -> Material {
        let (reflectivity, retroreflection) = (self.job.reflectivity.into(), self.retroreflection);
        let one = || Material { reflectivity, retroreflection };
        let barycentric = || {
            let ray = self.job.beam(pattern, hit.beam);
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
    /// Points of what is in the air.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub scattered: u64,
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
        self.scattered += other.scattered;
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
    let view = View::new(request, cast_effects)?;
    let start = request.pose_at_start();
    let origin = origin_for(start.position_m);
    let mut tally = Tally::default();
    let nearest = nearest_per_ray(objects, request.pattern.len());
    let mut returns = Vec::with_capacity(nearest.len());
    if view.has_one_echo_a_beam() {
        let mut normals = Normals::new(objects);
        let measured = |at| measure_one(&view, objects, at, &mut normals, &mut tally);
        returns.extend(nearest.iter().filter_map(measured));
    } else {
        measure_all(&view, objects, &nearest, &mut tally, &mut returns);
    }
    post_process(request, &mut returns);
    tally.points = returns.len() as u64;
    if view.air.is_some() {
        let is_of_air = |r: &&Return| matches!(r.source, Source::Air { .. });
        tally.scattered = returns.iter().filter(is_of_air).count() as u64;
    }
    let scan = Scan {
        origin: origin.to_array(),
        positions: returns.iter().map(|r| f32x3(view.place(&start, objects, r, origin))).collect(),
        ..Scan::default()
    };
    Ok((with_attributes(scan, &view, objects, &returns), tally))
}

/// Zero near the world's origin, else whole metres near the sensor.
fn origin_for(position_m: DVec3) -> DVec3 {
    if position_m.abs().max_element() < ORIGIN_BEYOND_M { DVec3::ZERO } else { position_m.round() }
}

fn f32x3(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// Places in `objects` and in its hits: one per ray of the `n_rays`, ascending. Of equal ranges
/// the object that comes first wins.
fn nearest_per_ray(objects: &[ObjectHits], n_rays: usize) -> Vec<(usize, usize)> {
    if let [alone] = objects {
        return (0..alone.hits.hits.len()).map(|i| (0, i)).collect();
    }
    const NOTHING: u32 = u32::MAX;
    let mut nearest = vec![(f64::INFINITY, NOTHING, 0u32); n_rays];
    for (object, found) in (0u32..).zip(objects) {
        for (hit, i) in found.hits.hits.iter().zip(0u32..) {
            let best = &mut nearest[hit.beam as usize];
            if best.1 == NOTHING || hit.range_m.total_cmp(&best.0).is_lt() {
                *best = (hit.range_m, object, i);
            }
        }
    }
    let found = nearest.into_iter().filter(|(_, object, _)| *object != NOTHING);
    found.map(|(_, object, i)| (object as usize, i as usize)).collect()
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
    let surface = |r: &Return| match r.source {
        Source::Surface { object, hit } => {
            let found = &objects[object as usize];
            Some((found, &found.hits.hits[hit as usize], hit as usize))
        }
        Source::Air { .. } => None,
    };
    let ray = |r: &Return| r.ray(objects);
    let pattern = view.request.pattern;
    let from_start =
        |r: &Return| view.start(ray(r)).map_or(r.from_sensor, |start| r.from_sensor - start);
    for attribute in &view.request.attributes {
        match attribute {
            Attribute::Range => {
                scan.range_m = column(returns, |r| from_start(r).length() as f32);
            }
            Attribute::Beam => scan.beam = column(returns, |r| pattern.beam_of(ray(r))),
            Attribute::Ring => scan.ring = column(returns, |r| pattern.ring[ray(r) as usize]),
            Attribute::Time => {
                scan.time_s = column(returns, |r| pattern.time_s[ray(r) as usize] as f32);
            }
            Attribute::Triangle => {
                scan.triangle =
                    column(returns, |r| surface(r).map_or(NONE, |(_, hit, _)| hit.triangle));
            }
            Attribute::Object => {
                scan.object =
                    column(returns, |r| surface(r).map_or(NONE, |(found, ..)| found.object));
            }
            // Of a surface in clear air it is the effect's, which a caster computes.
            Attribute::Intensity if view.air.is_some() => {
                scan.intensity = column(returns, |r| r.brightness);
            }
            Attribute::Intensity => {
                scan.intensity = column(returns, |r| {
                    surface(r).map_or(0.0, |(found, hit, number)| {
                        let effects = HitEffects::of(view.cast_effects, pattern, found, number);
                        let own = found.materials.map(|_| found.material(pattern, hit));
                        own.map_or(effects.intensity, |own| {
                            effects.intensity * own.reflectivity as f32
                        })
                    })
                });
            }
            Attribute::Power => scan.power = column(returns, |r| r.power),
            Attribute::Reflectivity => scan.reflectivity = column(returns, |r| r.reflectivity),
            Attribute::Return => scan.return_number = column(returns, |r| r.number),
            Attribute::Sensor => {
                let at = |r: &Return| view.request.pose_at(ray(r)).position_m;
                let origin = DVec3::from_array(scan.origin);
                scan.sensor_m = column(returns, |r| f32x3(at(r) - origin));
            }
            Attribute::Attitude => {
                let at = |r: &Return| view.request.pose_at(ray(r)).world_from_sensor;
                // Of the two quaternions of a rotation the one that turns by half a turn at most.
                let shorter = |q: DQuat| if q.w < 0.0 { -q } else { q };
                scan.attitude_rad = column(returns, |r| f32x3(shorter(at(r)).to_scaled_axis()));
            }
            Attribute::Medium => {
                scan.medium = column(returns, |r| match r.source {
                    Source::Surface { .. } => Medium::Surface as u8,
                    Source::Air { medium, .. } => medium as u8,
                });
            }
            Attribute::Normal => {
                scan.normal = column(returns, |r| {
                    surface(r).map_or([0.0; 3], |(found, hit, _)| {
                        normal(found, pattern, hit, from_start(r))
                    })
                });
            }
        }
    }
    scan
}

/// The triangle and the object of what is no surface.
const NONE: u32 = u32::MAX;

fn column<T>(returns: &[Return], value: impl Fn(&Return) -> T) -> Option<Vec<T>> {
    Some(returns.iter().map(value).collect())
}

/// The surface's unit normal in world axes, against the `beam` that hit it.
fn normal(found: &ObjectHits, pattern: &BeamPattern, hit: &Hit, beam: DVec3) -> [f32; 3] {
    let normal = unit_normal(found, pattern, hit);
    f32x3(if normal.dot(beam) > 0.0 { -normal } else { normal })
}
