//! Assembles a scan from hits: returns, their selection by the profile, and attributes.

use super::echo::Source;
use super::hit_effects::HitEffects;
use super::measure::{Return, measure};
use super::normals::unit_normal;
use super::object_hits::{HitId, ObjectHits, Tally};
use super::receiver::Receiver;
use super::request::ScanRequest;
use crate::config::InvalidValue;
use crate::effects::Effects;
use crate::pose::Pose;
use crate::weather::Medium;
use formats::scan::{Attribute, Scan};
use glam::{DQuat, DVec3};

/// Positions beyond this are stored relative to an origin near the sensor: f32 resolves 1 km to
/// 0.06 mm.
const ORIGIN_BEYOND_M: f64 = 1024.0;

/// Assembles the scan that `request` asks for from the hits of all `objects`, which a caster of
/// `cast_effects` computed. Points are in firing order.
pub fn assemble(
    request: &ScanRequest,
    cast_effects: &Effects,
    objects: &[ObjectHits],
) -> Result<(Scan, Tally), InvalidValue> {
    let receiver = Receiver::new(request, cast_effects, objects)?;
    let nearest = nearest_per_ray(objects, request.pattern.len());
    let mut points = Vec::with_capacity(nearest.len());
    let mut tally = measure(&receiver, &nearest, |r| points.push(r));
    tally.points = points.len() as u64;
    if receiver.air.is_some() {
        let is_of_air = |r: &&Return| matches!(r.source, Source::Air { .. });
        tally.scattered = points.iter().filter(is_of_air).count() as u64;
    }
    let start = request.pose_at_start();
    let origin = origin_for(start.position_m);
    let position = |r: &Return| f32x3(position(&receiver, &start, r, origin));
    let scan = Scan {
        origin: origin.to_array(),
        positions: points.iter().map(position).collect(),
        ..Scan::default()
    };
    Ok((with_attributes(scan, &receiver, &points), tally))
}

/// The origin of positions: zero near the world's, else whole metres near the sensor.
fn origin_for(position_m: DVec3) -> DVec3 {
    if position_m.abs().max_element() < ORIGIN_BEYOND_M { DVec3::ZERO } else { position_m.round() }
}

/// Where a point is stored, relative to `origin`, metres. The sensor was at `start` when the scan
/// began.
fn position(receiver: &Receiver, start: &Pose, r: &Return, origin: DVec3) -> DVec3 {
    let (request, ray) = (receiver.request, receiver.ray_of(r.source));
    let from_start = from_start(receiver, r);
    let from_sensor = receiver.start(ray).map_or(from_start, |start| from_start + start);
    if request.motion.is_none() {
        return from_sensor + (start.position_m - origin);
    }
    let pose = request.pose_at(ray);
    if request.deskew {
        return from_sensor + (pose.position_m - origin);
    }
    let in_sensor = pose.rotation.inverse() * from_sensor;
    start.rotation * in_sensor + (start.position_m - origin)
}

fn f32x3(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// The nearest hit of each of the `n_rays` rays that hit anything, by ray. The first of several
/// objects at the same range wins.
pub(super) fn nearest_per_ray(objects: &[ObjectHits], n_rays: usize) -> Vec<HitId> {
    if let [alone] = objects {
        return (0..alone.hits.hits.len() as u32).map(|hit| HitId { object: 0, hit }).collect();
    }
    const NO_HIT: HitId = HitId { object: u32::MAX, hit: 0 };
    let mut nearest = vec![(f64::INFINITY, NO_HIT); n_rays];
    for (object, of_object) in (0..).zip(objects) {
        for (hit, found) in (0..).zip(&of_object.hits.hits) {
            let best = &mut nearest[found.beam as usize];
            if best.1 == NO_HIT || found.range_m.total_cmp(&best.0).is_lt() {
                *best = (found.range_m, HitId { object, hit });
            }
        }
    }
    nearest.into_iter().map(|(_, id)| id).filter(|&id| id != NO_HIT).collect()
}

fn with_attributes(mut scan: Scan, receiver: &Receiver, points: &[Return]) -> Scan {
    let (request, pattern) = (receiver.request, receiver.pattern());
    let ray = |p: &Return| receiver.ray_of(p.source);
    for attribute in &request.attributes {
        match attribute {
            Attribute::Range => {
                scan.range_m = column(points, |p| range_m(receiver, p));
            }
            Attribute::Beam => scan.beam = column(points, |p| pattern.beam_of(ray(p))),
            Attribute::Ring => scan.ring = column(points, |p| pattern.ring[ray(p) as usize]),
            Attribute::Time => {
                scan.time_s = column(points, |p| pattern.time_s[ray(p) as usize] as f32);
            }
            Attribute::Triangle => {
                let triangle = |id| receiver.hit(id).triangle;
                scan.triangle = column(points, |p| surface(p).map_or(NONE, triangle));
            }
            Attribute::Object => {
                scan.object = column(points, |p| object(receiver, p));
            }
            Attribute::Intensity => {
                scan.intensity = column(points, |p| intensity(receiver, p));
            }
            Attribute::Power => scan.power = column(points, |p| p.power),
            Attribute::Reflectivity => scan.reflectivity = column(points, |p| p.reflectivity),
            Attribute::Return => scan.return_number = column(points, |p| p.number),
            Attribute::Sensor => {
                let at = |p: &Return| request.pose_at(ray(p)).position_m;
                let origin = DVec3::from_array(scan.origin);
                scan.sensor_m = column(points, |p| f32x3(at(p) - origin));
            }
            Attribute::Attitude => {
                let at = |p: &Return| request.pose_at(ray(p)).rotation;
                // The quaternion of the two that turns by at most half a turn.
                let shorter = |q: DQuat| if q.w < 0.0 { -q } else { q };
                scan.attitude_rad = column(points, |p| f32x3(shorter(at(p)).to_scaled_axis()));
            }
            Attribute::Medium => {
                scan.medium = column(points, |p| match p.source {
                    Source::Surface { .. } => Medium::Surface as u8,
                    Source::Air { medium, .. } => medium as u8,
                });
            }
            Attribute::Normal => {
                scan.normal = column(points, |p| {
                    let normal = |id| normal(receiver, id, from_start(receiver, p));
                    surface(p).map_or([0.0; 3], normal)
                });
            }
        }
    }
    scan
}

/// The triangle and the object of points that are not of a surface.
const NONE: u32 = u32::MAX;

fn surface(r: &Return) -> Option<HitId> {
    match r.source {
        Source::Surface(id) => Some(id),
        Source::Air { .. } => None,
    }
}

/// The measured point relative to the start of its beam, in world axes.
fn from_start(receiver: &Receiver, r: &Return) -> DVec3 {
    receiver.beam_direction(receiver.ray_of(r.source)) * r.range_m + r.aside_m
}

/// As [`Scan::range_m`].
pub(super) fn range_m(receiver: &Receiver, r: &Return) -> f32 {
    match r.aside_m == DVec3::ZERO {
        true => r.range_m as f32,
        false => from_start(receiver, r).length() as f32,
    }
}

/// As [`Scan::object`].
pub(super) fn object(receiver: &Receiver, r: &Return) -> u32 {
    surface(r).map_or(NONE, |id| receiver.object(id).object)
}

fn column<T>(points: &[Return], value: impl Fn(&Return) -> T) -> Option<Vec<T>> {
    Some(points.iter().map(value).collect())
}

/// The intensity of a hit as an effect, times the reflectivity of its material.
pub(super) fn intensity(receiver: &Receiver, r: &Return) -> f32 {
    // In clear air the intensity is that of the effect, which casters compute.
    if receiver.air.is_some() {
        return r.brightness;
    }
    let Some(id) = surface(r) else { return 0.0 };
    let (object, pattern) = (receiver.object(id), receiver.pattern());
    if object.is_uneven() {
        // Casters see the angles in the object's frame, which differ from those in the world.
        let hit = receiver.hit(id);
        let normal = unit_normal(object, pattern, hit);
        let cosine = normal.dot(receiver.direction(hit.beam)).abs().min(1.0);
        return (cosine * object.material(hit).reflectivity) as f32;
    }
    let HitEffects { intensity, .. } =
        HitEffects::of_hit(receiver.cast_effects, pattern, object, id);
    // Casters took the reflectivity of an object with materials for 1.
    match object.materials {
        Some(_) => intensity * object.material(receiver.hit(id)).reflectivity as f32,
        None => intensity,
    }
}

/// The surface's unit normal in world axes, facing against the `beam` that hit it.
fn normal(receiver: &Receiver, id: HitId, beam: DVec3) -> [f32; 3] {
    let normal = unit_normal(receiver.object(id), receiver.pattern(), receiver.hit(id));
    f32x3(if normal.dot(beam) > 0.0 { -normal } else { normal })
}
