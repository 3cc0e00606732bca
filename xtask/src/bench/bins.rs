//! Casting without a hierarchy, to see when one pays: the rays of one view
//! are binned by direction, and each triangle is tested against the rays in
//! the bins that its outline may cover.
//!
//! A prototype for measurement only. It answers as the CPU twin does, for
//! sensors outside the target's bounding sphere.

use super::shot::Shot;
use glam::{DMat3, DVec3, Mat3A, Vec3, Vec3A};
use sim_gpu::bvh::{LeafTriangle, canonical_corners};
use sim_gpu::cpu::intersect::{Shear, intersect};
use sim_gpu::ray::{AMBIGUOUS, MISS};
use sim_gpu::target::Surface;

/// How far outlines reach beyond their triangles on the plane at distance 1.
/// The triangle test accepts rays that pass outside by up to 48 units of 2^-24
/// (`cpu::intersect::DISPLACEMENT`) seen from a distance of at least 1, and
/// projecting rounds by less again.
const MARGIN: f32 = 1e-5;

/// Relative accuracy of a range that the answer must allow, as for the twin.
const ACCURACY: f32 = 1e-6;

/// The triangles of `surface`, in the order in which it keeps them.
pub fn leaf_triangles(surface: &Surface, kept: &[u32]) -> Vec<LeafTriangle> {
    let leaf = |&index: &u32| {
        let corners = surface.corners(index).map(|v| v.as_vec3().to_array());
        let [a, b, c] = canonical_corners(corners);
        LeafTriangle { a, index, b, _padding_b: 0, c, _padding_c: 0 }
    };
    kept.iter().map(leaf).collect()
}

/// The code of each ray of `shot`, all from one sensor; `None` if it stands
/// too near for all outlines to lie before it.
pub fn cast(triangles: &[LeafTriangle], shot: &Shot) -> Option<Vec<u32>> {
    let Some(first) = shot.rays.first() else { return Some(Vec::new()) };
    let sensor = first.origin;
    if sensor.length() <= shot.job.target.surface.radius + 1.0 {
        return None;
    }
    let view = View::towards_centre(sensor);
    let mut bins = Bins::new(&view, shot)?;
    for triangle in triangles {
        bins.rasterise(&view, triangle);
    }
    let mut codes = vec![MISS; shot.rays.len()];
    for ray in &bins.rays {
        codes[ray.number] = ray.code();
    }
    Some(codes)
}

/// A sensor that looks along z at the target's centre.
struct View {
    sensor: Vec3A,
    view_from_unit: Mat3A,
}

impl View {
    fn towards_centre(sensor: DVec3) -> Self {
        let z = -sensor.normalize();
        let (x, y) = z.any_orthonormal_pair();
        let view_from_unit = DMat3::from_cols(x, y, z).transpose();
        Self { sensor: sensor.as_vec3a(), view_from_unit: view_from_unit.as_mat3().into() }
    }

    /// Where the plane at distance 1 shows what lies in direction `v`.
    fn project(&self, v: Vec3A) -> [f32; 2] {
        let v = self.view_from_unit * v;
        let per_z = 1.0 / v.z;
        [v.x * per_z, v.y * per_z]
    }
}

/// A ray and what is known of the surfaces along it.
struct BinnedRay {
    at: [f32; 2],
    origin: Vec3,
    shear: Shear,
    skipped: f32,
    number: usize,
    t: f32,
    error: f32,
    index: u32,
    rival: f32,
}

impl BinnedRay {
    /// As `cpu::traverse::Nearest`.
    fn consider(&mut self, triangle: &LeafTriangle) {
        let Some(found) = intersect(self.origin, &self.shear, triangle) else { return };
        let wins = found.t < self.t || (found.t == self.t && triangle.index < self.index);
        let loser = if wins { self.t - self.error } else { found.t - found.error };
        self.rival = self.rival.min(loser);
        if wins {
            (self.t, self.error, self.index) = (found.t, found.error, triangle.index);
        }
    }

    fn code(&self) -> u32 {
        let doubt = self.t + self.error - self.rival;
        match self.index {
            MISS => MISS,
            index if doubt > ACCURACY * (self.skipped + self.t) => index | AMBIGUOUS,
            index => index,
        }
    }
}

/// The rays of one view, row by row of a square grid, each row bin by bin.
struct Bins {
    rays: Vec<BinnedRay>,
    /// Where each bin's rays start, `[side * side + 1]`.
    starts: Vec<u32>,
    side: usize,
    low: [f32; 2],
    per_bin: [f32; 2],
}

impl Bins {
    /// About one ray a bin; `None` if a ray points away from the centre.
    fn new(view: &View, shot: &Shot) -> Option<Self> {
        let side = (shot.rays.len() as f64).sqrt().ceil() as usize;
        let directions = || shot.job.rays.iter().map(|ray| Vec3A::from_array(ray.direction));
        if directions().any(|d| (view.view_from_unit * d).z < 0.1) {
            return None;
        }
        let points: Vec<[f32; 2]> = directions().map(|d| view.project(d)).collect();
        let fold = |axis: usize, pick: fn(f32, f32) -> f32| {
            points.iter().map(|p| p[axis]).reduce(pick).unwrap_or(0.0)
        };
        let low = [fold(0, f32::min), fold(1, f32::min)];
        let per_bin = [0, 1].map(|axis| {
            let width = (fold(axis, f32::max) - low[axis]).max(f32::MIN_POSITIVE);
            side as f32 / width
        });
        let mut bins =
            Self { rays: Vec::new(), starts: vec![0; side * side + 1], side, low, per_bin };
        let places: Vec<usize> =
            points.iter().map(|p| bins.bin(1, p[1]) * side + bins.bin(0, p[0])).collect();
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.sort_by_key(|&i| places[i as usize]);
        for &place in &places {
            bins.starts[place + 1] += 1;
        }
        for place in 0..side * side {
            bins.starts[place + 1] += bins.starts[place];
        }
        bins.rays = order
            .iter()
            .map(|&i| {
                let ray = &shot.job.rays[i as usize];
                BinnedRay {
                    at: points[i as usize],
                    origin: Vec3::from_array(ray.origin),
                    shear: Shear::of(Vec3::from_array(ray.direction)),
                    skipped: ray.skipped,
                    number: i as usize,
                    t: 1e30,
                    error: 0.0,
                    index: MISS,
                    rival: 1e30,
                }
            })
            .collect();
        Some(bins)
    }

    fn bin(&self, axis: usize, at: f32) -> usize {
        (((at - self.low[axis]) * self.per_bin[axis]) as usize).min(self.side - 1)
    }

    /// Tests `triangle` against the rays that its outline's box may hold.
    fn rasterise(&mut self, view: &View, triangle: &LeafTriangle) {
        let [a, b, c] = [triangle.a, triangle.b, triangle.c]
            .map(|corner| view.project(Vec3A::from_array(corner) - view.sensor));
        let low = [0, 1].map(|axis| a[axis].min(b[axis]).min(c[axis]) - MARGIN);
        let high = [0, 1].map(|axis| a[axis].max(b[axis]).max(c[axis]) + MARGIN);
        let (left, right) = (self.bin(0, low[0]), self.bin(0, high[0]));
        for row in self.bin(1, low[1])..=self.bin(1, high[1]) {
            let first = self.starts[row * self.side + left] as usize;
            let end = self.starts[row * self.side + right + 1] as usize;
            for ray in &mut self.rays[first..end] {
                let inside = |axis: usize| low[axis] <= ray.at[axis] && ray.at[axis] <= high[axis];
                if inside(0) && inside(1) {
                    ray.consider(triangle);
                }
            }
        }
    }
}
