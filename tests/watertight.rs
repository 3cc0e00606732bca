//! Rays aimed exactly at the vertices and edge midpoints of a closed surface:
//! none may slip through, on any caster.

use std::collections::BTreeSet;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use sim_gpu::cpu::oracle;
use sim_gpu::effects::Effects;
use sim_gpu::mesh::Mesh;
use sim_gpu::ray::MISS;
use sim_gpu::resolve::resolve;
use sim_gpu::sensor::BeamPattern;
use sim_gpu::target::Target;
use tests::adapter::casters;
use tests::casting::{at, beams, cast, hits, job, target, tree_bytes};
use tests::judge::judge;
use tests::meshes::{cube, icosphere, mapped, tiled_cube, unmerged};
use tests::random::Random;

const SENSORS: usize = 20;

/// The sphere of 20,480 triangles, moved and rotated.
fn moved_sphere() -> Mesh {
    let rotation = Random::new("watertight").rotation();
    mapped(&icosphere(5), |v| rotation * v * 1.7 + DVec3::new(12.3, -4.5, 6.7))
}

/// The corners and edge midpoints of `target` as its casters hold them, in
/// the unit frame: rays at the f64 positions would pass the f32 ones by up to
/// 2^-25, where nothing is put to the test.
fn corners_and_midpoints(target: &Target) -> Vec<DVec3> {
    let bits = |v: [f32; 3]| v.map(f32::to_bits);
    let mut corners = BTreeSet::new();
    let mut edges = BTreeSet::new();
    for t in &target.bvh.triangles {
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

/// A position in the unit frame, seen from the world.
fn in_world(target: &Target, unit: DVec3) -> DVec3 {
    let frame = &target.surface.frame;
    unit * frame.scale + frame.centre
}

fn aimed(target: &Target, sensor: DVec3, points: &[DVec3]) -> BeamPattern {
    let scale = target.surface.frame.scale;
    beams(points.iter().map(|&p| p * scale - sensor * scale))
}

/// Casts from `SENSORS` places inside at all corners and edges; how many rays.
fn cast_from_inside(mesh: &Mesh, expected: usize) {
    let target = &target(mesh);
    let points = corners_and_midpoints(target);
    assert_eq!(points.len() * SENSORS, expected);
    let mut random = Random::new("inside");
    let mut missed: Vec<(&str, usize)> = Vec::new();
    for _ in 0..SENSORS {
        // Exact in f32, so that the caster's ray starts just there.
        let sensor = (random.in_cube() * 0.4).as_vec3().as_dvec3();
        let pattern = aimed(target, sensor, &points);
        let job = job(target, &at(in_world(target, sensor)), &pattern);
        for caster in casters(&Effects::default()) {
            let cast = cast(caster, &job);
            // Before f64 has its say on any ray, and after.
            let misses = cast.codes.iter().filter(|&&code| code == MISS).count();
            let hits = resolve(&job, &cast, &pattern, caster.effects());
            missed.push((caster.name(), points.len() - cast.codes.len() + misses));
            missed.push((caster.name(), points.len() - hits.hits.len()));
        }
        let oracle_misses = (0..points.len())
            .into_par_iter()
            .filter(|&i| oracle::nearest(target, &job.frame.ray(pattern.directions[i])).is_none());
        missed.push(("oracle", oracle_misses.count()));
    }
    let total: usize = missed.iter().map(|(_, n)| n).sum();
    assert_eq!(total, 0, "{missed:?}");
}

#[test]
fn no_ray_of_819_240_leaves_a_closed_sphere() {
    cast_from_inside(&moved_sphere(), 819_240);
}

/// Casters see positions, not vertices: what a file merges makes no difference, so
/// that no ray leaves a sphere whose triangles share no vertex either.
#[test]
fn triangles_that_share_no_vertex_make_the_same_target() {
    let sphere = moved_sphere();
    let [shared, apart] = [&sphere, &unmerged(&sphere)].map(target);
    assert!(tree_bytes(&shared.bvh) == tree_bytes(&apart.bvh), "the trees differ");
    assert_eq!(shared.surface.frame, apart.surface.frame);
    for triangle in 0..sphere.triangles.len() as u32 {
        assert_eq!(shared.surface.corners(triangle), apart.surface.corners(triangle));
    }
}

#[test]
fn no_ray_leaves_a_cube() {
    // 8 corners; 12 edges and a diagonal on each of 6 faces.
    cast_from_inside(&cube(), (8 + 18) * SENSORS);
}

/// Squares of a third of a power of two: no coordinate is exact in f32, and
/// flat boxes meet at every edge.
#[test]
fn no_ray_leaves_a_tiled_cube() {
    // (48 + 1)^2 on 6 faces, shared along 12 edges and at 8 corners; edges by
    // Euler's formula.
    let vertices = 6 * 48 * 48 + 2;
    let edges = vertices + 12 * 48 * 48 - 2;
    cast_from_inside(&tiled_cube(48), (vertices + edges) * SENSORS);
}

#[test]
fn no_ray_enters_a_sphere_between_two_triangles() {
    let target = target(&moved_sphere());
    let mut random = Random::new("outside");
    for _ in 0..4 {
        let sensor = random.direction() * 3.0;
        // What faces the sensor: within 53 degrees of the line to the centre,
        // where the silhouette of a sphere seen from 3 radii is at 70.
        let facing = |p: &DVec3| p.normalize().dot(sensor) > 0.6 * 3.0;
        let points: Vec<DVec3> =
            corners_and_midpoints(&target).into_iter().filter(facing).collect();
        assert!(points.len() > 5_000);
        let pattern = aimed(&target, sensor, &points);
        let job = job(&target, &at(in_world(&target, sensor)), &pattern);
        for caster in casters(&Effects::default()) {
            let hits = hits(caster, &job, &pattern);
            assert_eq!(hits.hits.len(), points.len(), "{}", caster.name());
            // A ray that slips in hits the far side: the range shows it.
            let verdict = judge(&job, &pattern, &hits);
            println!("{}: {verdict}", caster.name());
            assert_eq!(verdict.at_silhouettes, 0);
            verdict.assert_kept(caster.name());
        }
    }
}
