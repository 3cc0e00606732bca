//! Rays aimed exactly at the vertices and edge midpoints of a closed surface.

use std::collections::BTreeSet;

use edgepuck_mesh::TriangleMesh;
use glam::{DVec3, Vec3};
use sim_gpu::internals::cast_error::CastError;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::job::CastJob;
use sim_gpu::internals::ray::MISS;
use sim_gpu::internals::resolve::resolve;
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::Target;

use crate::casting::{at, beams, job};
use crate::meshes::{icosphere, mapped};
use crate::random::Random;

/// Sensors within a surface.
pub const SENSORS: usize = 20;

/// A sphere of `20 * 4^level` triangles, moved and rotated. From [`SENSORS`] sensors within
/// that of level 5, 819,240 rays are aimed at its vertices and edges.
pub fn moved_sphere(level: u32) -> TriangleMesh {
    let rotation = Random::new("watertight").rotation();
    mapped(&icosphere(level), |v| rotation * v * 1.7 + DVec3::new(12.3, -4.5, 6.7))
}

/// The corners and edge midpoints of `target` as its casters hold them, in
/// the unit frame: rays at the f64 positions would pass the f32 ones by up to
/// 2^-25, where nothing is put to the test.
pub fn corners_and_midpoints(target: &Target) -> Vec<DVec3> {
    let bits = |v: [f32; 3]| v.map(f32::to_bits);
    let mut corners = BTreeSet::new();
    let mut edges = BTreeSet::new();
    for t in &target.bvh.two_wide().triangles {
        // Corners are in canonical order, so an edge is the same pair in both
        // triangles.
        let [a, b, c] = [t.a, t.b, t.c].map(bits);
        corners.extend([a, b, c]);
        edges.extend([[a, b], [a, c], [b, c]]);
    }
    let point = |bits: [u32; 3]| Vec3::from_array(bits.map(f32::from_bits)).as_dvec3();
    let midpoints = edges.iter().map(|&[p, q]| (point(p) + point(q)) * 0.5);
    corners.iter().map(|&p| point(p)).chain(midpoints).collect()
}

/// A beam from `sensor` through each of `points`, all in the unit frame of `target`.
pub fn aimed(target: &Target, sensor: DVec3, points: &[DVec3]) -> (CastJob, BeamPattern) {
    let frame = &target.surface.frame;
    let pattern = beams(points.iter().map(|&p| p * frame.scale - sensor * frame.scale));
    (job(target, &at(sensor * frame.scale + frame.centre), &pattern), pattern)
}

/// A beam from each of [`SENSORS`] places within `target` to each corner and edge midpoint.
pub fn from_inside(target: &Target) -> impl Iterator<Item = (CastJob, BeamPattern)> {
    let points = corners_and_midpoints(target);
    let mut random = Random::new("inside");
    (0..SENSORS).map(move |_| {
        // Exact in f32, so that the caster's ray starts just there.
        let sensor = (random.in_cube() * 0.4).as_vec3().as_dvec3();
        aimed(target, sensor, &points)
    })
}

/// How many beams miss when `caster` casts `job`: before f64 has its say on any ray, and after.
pub fn missed(
    caster: &OpenCaster,
    job: &CastJob,
    pattern: &BeamPattern,
) -> Result<[usize; 2], CastError> {
    let cast = caster.cast(std::slice::from_ref(job))?.swap_remove(0);
    let hit = cast.codes.iter().filter(|&&code| code != MISS).count();
    let hits = resolve(job, &cast, pattern, caster.effects());
    Ok([hit, hits.hits.len()].map(|n| pattern.len() - n))
}
