//! Rays in an object's own frame.

use crate::pose::Pose;
use crate::sensor::{BeamPattern, Cone};
use crate::target::Surface;
use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat3, DVec3};

/// One ray as casters read it. `shaders/shared/ray.wgsl` declares the same; a
/// test compares size and offsets.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct TraceRay {
    /// Where the ray starts, in the unit frame: on the object's bounding
    /// sphere, or the sensor itself if it is inside.
    pub origin: [f32; 3],
    /// The root node of the object's tree in the caster's buffer.
    pub root: u32,
    /// Unit direction in the unit frame.
    pub direction: [f32; 3],
    /// Distance from the sensor to `origin`, in unit lengths.
    pub skipped: f32,
}

/// What a caster answers where a ray hits nothing.
pub const MISS: u32 = u32::MAX;

/// The distance of a ray that hits nothing, unit lengths: beyond every other
/// distance, and finite.
pub const NO_HIT: f32 = 1e30;

/// Set in a caster's answer where another triangle may be truly nearer by
/// more than the promised accuracy, and f64 must decide.
pub const AMBIGUOUS: u32 = 1 << 31;

/// A ray in f64. `origin + t * direction` is `t` metres from the ray's start.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where the ray starts, in the unit frame: the sensor, or near it.
    pub origin: DVec3,
    /// One metre along the beam, in the unit frame.
    pub direction: DVec3,
}

/// How one sensor sees one object: sends beams into the object's unit frame.
#[derive(Clone, Copy, Debug)]
pub struct RayFrame {
    origin: DVec3,
    unit_from_sensor: DMat3,
    radius: f64,
}

impl RayFrame {
    /// The frame of a sensor at `pose` that looks at `surface`, placed in the
    /// world by `world_from_object`.
    ///
    /// Differences of positions are taken first, so that a scene far from the
    /// world's origin loses nothing but what its own coordinates lack.
    #[must_use]
    pub fn new(surface: &Surface, world_from_object: &DAffine3, pose: &Pose) -> Self {
        let object_from_world = world_from_object.matrix3.inverse();
        let in_object = object_from_world * (pose.position_m - world_from_object.translation);
        let world_from_sensor = DMat3::from_quat(pose.world_from_sensor);
        Self {
            origin: surface.frame.to_unit(in_object),
            unit_from_sensor: object_from_world * world_from_sensor * surface.frame.scale.recip(),
            radius: surface.radius,
        }
    }

    /// The beam that leaves the sensor in `direction`, a unit vector in the
    /// sensor frame.
    #[must_use]
    pub fn ray(&self, direction: DVec3) -> Ray {
        Ray { origin: self.origin, direction: self.unit_from_sensor * direction }
    }

    /// The ray of `pattern`'s beam of this number, from where that beam starts.
    #[must_use]
    pub fn beam(&self, pattern: &BeamPattern, beam: u32) -> Ray {
        let from_sensor = self.ray(pattern.directions[beam as usize]);
        match pattern.start(beam) {
            None => from_sensor,
            Some(start) => {
                Ray { origin: self.origin + self.unit_from_sensor * start, ..from_sensor }
            }
        }
    }

    /// The cone of directions in which `pattern`'s beams may hit the object's
    /// bounding sphere.
    ///
    /// A beam that starts beside the sensor hits the sphere if one from the
    /// sensor, in the same direction, hits the sphere moved as far the other
    /// way. A sphere that is larger by the farthest start holds all of these.
    #[must_use]
    pub fn cone(&self, pattern: &BeamPattern) -> Cone {
        let radius = match pattern.farthest_start_m() {
            0.0 => self.radius,
            along_z_m => self.radius + self.unit_from_sensor.z_axis.length() * along_z_m,
        };
        let everything = Cone { axis: DVec3::X, half_angle_rad: std::f64::consts::PI };
        let distance = self.origin.length();
        let sensor_from_unit = self.unit_from_sensor.inverse();
        let stretch = anisotropy(&self.unit_from_sensor);
        let Some(axis) = (sensor_from_unit * -self.origin).try_normalize() else {
            return everything;
        };
        let sine = radius / distance * stretch;
        if sine.is_nan() || sine >= 1.0 {
            return everything;
        }
        Cone { axis, half_angle_rad: sine.asin() }
    }

    /// A distance from where `pattern`'s beams start, metres, within which there is
    /// nothing of the object; 0 if the sensor is inside its bounding sphere.
    #[must_use]
    pub fn nearest_m(&self, pattern: &BeamPattern) -> f64 {
        let unit_per_m = stretches(&self.unit_from_sensor).1;
        let from_sensor_m = (self.origin.length() - self.radius) / unit_per_m;
        let nearest_m = from_sensor_m - pattern.farthest_start_m();
        // One part in 10^9 less, for rounding; NaN gives 0.
        (nearest_m * (1.0 - 1e-9)).max(0.0)
    }

    /// The record of `ray` for a tree whose root is node `root`; `None` if the
    /// ray passes the bounding sphere by.
    #[must_use]
    pub fn trace_ray(&self, ray: &Ray, root: u32) -> Option<TraceRay> {
        let direction = ray.direction.normalize();
        let along = -ray.origin.dot(direction);
        let closest = ray.origin + direction * along;
        let half_chord_squared = self.radius * self.radius - closest.length_squared();
        if half_chord_squared.is_nan() || half_chord_squared < 0.0 {
            return None;
        }
        let half_chord = half_chord_squared.sqrt();
        if along + half_chord < 0.0 {
            return None;
        }
        let skipped = (along - half_chord).max(0.0);
        Some(record(ray.origin, direction, skipped, root))
    }

    /// The record of a ray whether or not it can hit: what is cast when
    /// culling is off.
    #[must_use]
    pub fn trace_ray_unculled(&self, ray: &Ray, root: u32) -> TraceRay {
        self.trace_ray(ray, root).unwrap_or_else(|| {
            let direction = ray.direction.normalize();
            let skipped = (-ray.origin.dot(direction) - self.radius).max(0.0);
            record(ray.origin, direction, skipped, root)
        })
    }
}

fn record(origin: DVec3, direction: DVec3, skipped: f64, root: u32) -> TraceRay {
    TraceRay {
        origin: (origin + direction * skipped).as_vec3().to_array(),
        root,
        direction: direction.as_vec3().to_array(),
        skipped: skipped as f32,
    }
}

/// Largest over smallest stretch of a map; 1 for a uniform scale. An object
/// scaled unevenly looks wider than its unit sphere by at most this.
fn anisotropy(map: &DMat3) -> f64 {
    let (least, most) = stretches(map);
    if least > 0.0 { most / least } else { f64::INFINITY }
}

/// Bounds of how far a map stretches a vector: at least the first, at most the
/// second.
fn stretches(map: &DMat3) -> (f64, f64) {
    let gram = map.transpose() * *map;
    let (low, high) = (0..3).map(|i| gram.col(i).to_array().map(f64::abs)).enumerate().fold(
        (f64::INFINITY, 0.0f64),
        |(low, high), (i, column)| {
            // Gershgorin's discs bound the eigenvalues.
            let off: f64 = column.iter().sum::<f64>() - column[i];
            (low.min(column[i] - off), high.max(column[i] + off))
        },
    );
    (low.max(0.0).sqrt(), high.sqrt())
}
