//! Rays in the unit frame of an object.

use crate::fixed_frame::FixedFrame;
use crate::lanes::{LANES, Lanewise, Vectors, each, widest};
use crate::pose::Pose;
use crate::sensor::{BeamPattern, Cone, starts};
use crate::target::Surface;
use bytemuck::{Pod, Zeroable};
use fearless_simd::Simd;
use glam::{DAffine3, DMat3, DVec3};

/// A ray as casters read it. `shaders/shared/ray.wgsl` declares the same record; a test compares
/// sizes and offsets.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct TraceRay {
    /// The start of the ray in the unit frame: on the object's bounding sphere, or the sensor if
    /// it is inside.
    pub origin: [f32; 3],
    /// The root node of the object's tree in the caster's buffer.
    pub root: u32,
    /// Unit direction in the unit frame.
    pub direction: [f32; 3],
    /// Fills the record up to WGSL's array stride.
    pub _padding: u32,
}

/// A caster's answer for a ray that hits nothing.
pub const MISS: u32 = u32::MAX;

/// The first direction of a view whose rays are sent to the GPU instead of made there.
#[cfg(feature = "gpu")]
pub(crate) const SENT: u32 = u32::MAX;

/// The distance for a ray that hits nothing, unit lengths: finite, and beyond every other distance.
pub const NO_HIT: f32 = 1e30;

/// A bit of a caster's answer: the ray may truly miss the triangle, or meet another one before it, and
/// f64 must decide.
pub const AMBIGUOUS: u32 = 1 << 31;

/// A ray in f64. `origin + t * direction` is `t` metres from the ray's start.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// The start of the ray in the unit frame: the sensor, or near it.
    pub origin: DVec3,
    /// One metre along the ray, in the unit frame.
    pub direction: DVec3,
}

/// The map from the frame of one sensor to the unit frame of one object.
#[derive(Clone, Copy, Debug)]
pub struct RayFrame {
    origin: DVec3,
    unit_from_sensor: DMat3,
    radius: f64,
}

impl RayFrame {
    /// The frame of a sensor at `pose` and of `surface`, placed in the world by
    /// `world_from_object`.
    ///
    /// Positions are subtracted before anything else, so that a scene far from the world's origin
    /// loses no more accuracy than its own coordinates have.
    #[must_use]
    pub fn new(surface: &Surface, world_from_object: &DAffine3, pose: &Pose) -> Self {
        let object_from_world = world_from_object.matrix3.inverse();
        let in_object = object_from_world * (pose.position_m - world_from_object.translation);
        let rotation = DMat3::from_quat(pose.rotation);
        Self {
            origin: surface.frame.to_unit(in_object),
            unit_from_sensor: object_from_world * rotation * surface.frame.scale.recip(),
            radius: surface.radius,
        }
    }

    /// The ray from the sensor in `direction`, a unit vector in the sensor frame.
    #[must_use]
    pub fn ray(&self, direction: DVec3) -> Ray {
        Ray { origin: self.origin, direction: self.unit_from_sensor * direction }
    }

    /// Ray number `beam` of `pattern`.
    #[must_use]
    pub fn beam(&self, pattern: &BeamPattern, beam: u32) -> Ray {
        let ray = self.beams(pattern, [beam]);
        Ray { origin: ray.origin.lane(0), direction: ray.direction.lane(0) }
    }

    #[inline(always)]
    pub(crate) fn beams<const N: usize>(&self, pattern: &BeamPattern, beams: [u32; N]) -> Rays<N> {
        self.rays(&pattern.directions, &pattern.starts_m, beams)
    }

    /// Some of the rays with these directions and starts.
    #[inline(always)]
    fn rays<const N: usize>(
        &self,
        directions: &[DVec3],
        starts_m: &[DVec3],
        beams: [u32; N],
    ) -> Rays<N> {
        let directions = each(|lane| directions[beams[lane] as usize]);
        let mut origin = Vectors::new([self.origin; N]);
        if let Some(starts) = starts(starts_m, beams) {
            origin = origin + Vectors::new(starts).mapped(&self.unit_from_sensor);
        }
        Rays { origin, direction: Vectors::new(directions).mapped(&self.unit_from_sensor) }
    }

    /// This frame in integers, if they are exact enough for it.
    #[must_use]
    pub fn fixed(&self) -> Option<FixedFrame> {
        FixedFrame::new(self.origin, &self.unit_from_sensor, self.radius)
    }

    /// The cone of directions in which `pattern`'s rays may hit the object's bounding sphere.
    ///
    /// A ray that starts beside the sensor hits the sphere if a parallel ray from the sensor hits
    /// the sphere moved as far the other way. A sphere enlarged by the farthest start holds all of
    /// these spheres.
    #[must_use]
    pub fn cone(&self, pattern: &BeamPattern) -> Cone {
        let radius = match pattern.farthest_start_m() {
            0.0 => self.radius,
            farthest_m => self.radius + stretches(&self.unit_from_sensor).1 * farthest_m,
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
        Cone { axis, half_angle_rad: libm::asin(sine) }
    }

    /// A lower bound of the distance from the start of any of `pattern`'s rays to the object,
    /// metres; 0 if the sensor is inside its bounding sphere.
    #[must_use]
    pub fn nearest_m(&self, pattern: &BeamPattern) -> f64 {
        let unit_per_m = stretches(&self.unit_from_sensor).1;
        let from_sensor_m = (self.origin.length() - self.radius) / unit_per_m;
        let nearest_m = from_sensor_m - pattern.farthest_start_m();
        // Less one part in 10^9, for rounding; NaN gives 0.
        (nearest_m * (1.0 - 1e-9)).max(0.0)
    }

    /// The record of `ray` for the tree at `root`; `None` if the ray misses the bounding sphere.
    #[must_use]
    pub fn trace_ray(&self, ray: &Ray, root: u32) -> Option<TraceRay> {
        let entry = Entries::new(&Rays::one(ray), self.radius);
        entry.is_hit[0].then(|| entry.records(root)[0])
    }

    /// The record of a ray whether or not it can hit, for casting without culling.
    #[must_use]
    pub fn trace_ray_unculled(&self, ray: &Ray, root: u32) -> TraceRay {
        Entries::new(&Rays::one(ray), self.radius).records(root)[0]
    }

    /// Those of `beams`, as indices of these directions and starts, that meet the bounding sphere,
    /// or `all` of them; and their records for a tree whose root is node 0.
    pub(crate) fn trace_rays(
        &self,
        directions: &[DVec3],
        starts_m: &[DVec3],
        mut beams: Vec<u32>,
        all: bool,
    ) -> (Vec<u32>, Vec<TraceRay>) {
        let mut rays = vec![TraceRay::zeroed(); beams.len()];
        let (of_beams, of_rays) = (&mut beams[..], &mut rays[..]);
        let aiming =
            Aiming { frame: self, directions, starts_m, beams: of_beams, rays: of_rays, all };
        let kept = widest(aiming);
        beams.truncate(kept);
        rays.truncate(kept);
        (beams, rays)
    }
}

/// Moves the beams that [`RayFrame::trace_rays`] keeps and their records to the front, and returns
/// their number.
struct Aiming<'a> {
    frame: &'a RayFrame,
    directions: &'a [DVec3],
    starts_m: &'a [DVec3],
    beams: &'a mut [u32],
    rays: &'a mut [TraceRay],
    all: bool,
}

impl Lanewise for Aiming<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> usize {
        let mut kept = 0;
        for from in (0..self.beams.len()).step_by(LANES) {
            let count = LANES.min(self.beams.len() - from);
            let beams: [u32; LANES] = each(|lane| self.beams[from + lane.min(count - 1)]);
            let rays = self.frame.rays(self.directions, self.starts_m, beams);
            let entries = Entries::new(&rays, self.frame.radius);
            let records = entries.records(0);
            for lane in 0..count {
                // Written always and kept by the count: faster than a branch for each ray.
                (self.beams[kept], self.rays[kept]) = (beams[lane], records[lane]);
                kept += usize::from(entries.is_hit[lane] || self.all);
            }
        }
        kept
    }
}

/// Rays in f64, one in each lane.
#[derive(Clone, Copy)]
pub(crate) struct Rays<const N: usize> {
    pub origin: Vectors<N>,
    pub direction: Vectors<N>,
}

impl Rays<1> {
    #[inline(always)]
    pub fn one(ray: &Ray) -> Self {
        Self { origin: Vectors::new([ray.origin]), direction: Vectors::new([ray.direction]) }
    }
}

struct Entries<const N: usize> {
    /// The starts of the rays.
    origin: Vectors<N>,
    /// Unit directions.
    direction: Vectors<N>,
    /// The distance from its start at which each ray enters the sphere; for a ray that misses it,
    /// a distance within which it meets nothing.
    skipped: [f64; N],
    is_hit: [bool; N],
}

impl<const N: usize> Entries<N> {
    #[inline(always)]
    fn new(rays: &Rays<N>, radius: f64) -> Self {
        let (origin, direction) = (rays.origin, rays.direction.normalize());
        let along = origin.dot(&direction);
        let along = each(|i| -along[i]);
        let closest = origin + direction * along;
        let closest_squared = closest.dot(&closest);
        let half_chord_squared: [f64; N] = each(|i| radius * radius - closest_squared[i]);
        // NaN for a ray that misses the sphere or overflows.
        let half_chord: [f64; N] = each(|i| half_chord_squared[i].sqrt());
        let is_hit = each(|i| along[i] + half_chord[i] >= 0.0);
        let skipped = each(|i| {
            let back = if half_chord_squared[i] >= 0.0 { half_chord[i] } else { radius };
            let skipped = along[i] - back;
            if skipped > 0.0 { skipped } else { 0.0 }
        });
        Self { origin, direction, skipped, is_hit }
    }

    #[inline(always)]
    fn records(&self, root: u32) -> [TraceRay; N] {
        let origin = self.origin + self.direction * self.skipped;
        each(|i| TraceRay {
            origin: origin.lane(i).as_vec3().to_array(),
            root,
            direction: self.direction.lane(i).as_vec3().to_array(),
            _padding: 0,
        })
    }
}

/// The largest over the smallest stretch of a map; 1 for a uniform scale. It bounds how much wider
/// than its unit sphere an unevenly scaled object looks.
fn anisotropy(map: &DMat3) -> f64 {
    let (least, most) = stretches(map);
    if least > 0.0 { most / least } else { f64::INFINITY }
}

/// The lower and the upper bound of how far a map stretches vectors.
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
