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
use crate::sensor::{SensorProfile, polar_angle_rad};
use crate::weather::Medium;
use formats::rng::StreamKey;
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
    let (mut returns, mut tally) = measure(&receiver, &nearest);
    post_process(request, &mut returns);
    tally.points = returns.len() as u64;
    if receiver.air.is_some() {
        let is_of_air = |r: &&Return| matches!(r.source, Source::Air { .. });
        tally.scattered = returns.iter().filter(is_of_air).count() as u64;
    }
    let start = request.pose_at_start();
    let origin = origin_for(start.position_m);
    let position = |r: &Return| f32x3(position(&receiver, &start, r, origin));
    let scan = Scan {
        origin: origin.to_array(),
        positions: returns.iter().map(position).collect(),
        ..Scan::default()
    };
    Ok((with_attributes(scan, &receiver, &returns), tally))
}

/// The origin of positions: zero near the world's, else whole metres near the sensor.
fn origin_for(position_m: DVec3) -> DVec3 {
    if position_m.abs().max_element() < ORIGIN_BEYOND_M { DVec3::ZERO } else { position_m.round() }
}

/// Where a point is stored, relative to `origin`, metres. The sensor was at `start` when the scan
/// began.
fn position(receiver: &Receiver, start: &Pose, r: &Return, origin: DVec3) -> DVec3 {
    let request = receiver.request;
    if request.motion.is_none() {
        return r.from_sensor + (start.position_m - origin);
    }
    let pose = request.pose_at(receiver.ray_of(r.source));
    if request.deskew {
        return r.from_sensor + (pose.position_m - origin);
    }
    let in_sensor = pose.rotation.inverse() * r.from_sensor;
    start.rotation * in_sensor + (start.position_m - origin)
}

fn f32x3(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// The nearest hit of each of the `n_rays` rays that hit anything, by ray. The first of several
/// objects at the same range wins.
fn nearest_per_ray(objects: &[ObjectHits], n_rays: usize) -> Vec<HitId> {
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

/// Applies the rings and the sampling of points that a sensor's profile may ask for.
fn post_process(request: &ScanRequest, returns: &mut Vec<Return>) {
    let SensorProfile { rings, sample, .. } = request.sensor;
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

fn with_attributes(mut scan: Scan, receiver: &Receiver, returns: &[Return]) -> Scan {
    let surface = |r: &Return| match r.source {
        Source::Surface(id) => Some(id),
        Source::Air { .. } => None,
    };
    let (request, pattern) = (receiver.request, receiver.pattern());
    let ray = |r: &Return| receiver.ray_of(r.source);
    let from_start =
        |r: &Return| receiver.start(ray(r)).map_or(r.from_sensor, |start| r.from_sensor - start);
    for attribute in &request.attributes {
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
                let triangle = |id| receiver.hit(id).triangle;
                scan.triangle = column(returns, |r| surface(r).map_or(NONE, triangle));
            }
            Attribute::Object => {
                let object = |id| receiver.object(id).object;
                scan.object = column(returns, |r| surface(r).map_or(NONE, object));
            }
            // In clear air the intensity is that of the effect, which casters compute.
            Attribute::Intensity if receiver.air.is_some() => {
                scan.intensity = column(returns, |r| r.brightness);
            }
            Attribute::Intensity => {
                let intensity = |id| intensity(receiver, id);
                scan.intensity = column(returns, |r| surface(r).map_or(0.0, intensity));
            }
            Attribute::Power => scan.power = column(returns, |r| r.power),
            Attribute::Reflectivity => scan.reflectivity = column(returns, |r| r.reflectivity),
            Attribute::Return => scan.return_number = column(returns, |r| r.number),
            Attribute::Sensor => {
                let at = |r: &Return| request.pose_at(ray(r)).position_m;
                let origin = DVec3::from_array(scan.origin);
                scan.sensor_m = column(returns, |r| f32x3(at(r) - origin));
            }
            Attribute::Attitude => {
                let at = |r: &Return| request.pose_at(ray(r)).rotation;
                // The quaternion of the two that turns by at most half a turn.
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
                    let normal = |id| normal(receiver, id, from_start(r));
                    surface(r).map_or([0.0; 3], normal)
                });
            }
        }
    }
    scan
}

/// The triangle and the object of points that are not of a surface.
const NONE: u32 = u32::MAX;

fn column<T>(returns: &[Return], value: impl Fn(&Return) -> T) -> Option<Vec<T>> {
    Some(returns.iter().map(value).collect())
}

/// The intensity of a hit as an effect, times the reflectivity of its material.
fn intensity(receiver: &Receiver, id: HitId) -> f32 {
    let (object, pattern) = (receiver.object(id), receiver.pattern());
    let HitEffects { intensity, .. } =
        HitEffects::of_hit(receiver.cast_effects, pattern, object, id);
    // Casters took the reflectivity of an object with materials for 1.
    match object.materials {
        Some(_) => intensity * object.material(pattern, receiver.hit(id)).reflectivity as f32,
        None => intensity,
    }
}

/// The surface's unit normal in world axes, facing against the `beam` that hit it.
fn normal(receiver: &Receiver, id: HitId, beam: DVec3) -> [f32; 3] {
    let normal = unit_normal(receiver.object(id), receiver.pattern(), receiver.hit(id));
    f32x3(if normal.dot(beam) > 0.0 { -normal } else { normal })
}
