//! Rays aimed exactly at the vertices and edge midpoints of a closed surface:
//! none may slip through, on any caster.

use edgepuck_mesh::TriangleMesh;
use glam::DVec3;
use rayon::prelude::*;
use sim_gpu::effects::Effects;
use sim_gpu::internals::cpu::oracle;
use tests::adapter::casters;
use tests::adversarial::{
    SENSORS, aimed, corners_and_midpoints, from_inside, missed, moved_sphere,
};
use tests::casting::{hits, target, tree_bytes};
use tests::judge::judge;
use tests::meshes::{cube, tiled_cube, unmerged};
use tests::random::Random;

/// Casts from `SENSORS` places inside at all corners and edges; how many rays.
fn cast_from_inside(mesh: &TriangleMesh, expected: usize) {
    let target = &target(mesh);
    assert_eq!(corners_and_midpoints(target).len() * SENSORS, expected);
    let mut lost: Vec<(&str, [usize; 2])> = Vec::new();
    for (job, pattern) in from_inside(target) {
        for caster in casters(&Effects::default()) {
            let missed = missed(caster, &job, &pattern).expect("the adapter casts");
            lost.push((caster.name(), missed));
        }
        let oracle_misses = (0..pattern.len())
            .into_par_iter()
            .filter(|&i| oracle::nearest(target, &job.frame.ray(pattern.directions[i])).is_none());
        lost.push(("oracle", [oracle_misses.count(), 0]));
    }
    assert!(lost.iter().all(|(_, n)| *n == [0, 0]), "{lost:?}");
}

#[test]
fn no_ray_of_819_240_leaves_a_closed_sphere() {
    cast_from_inside(&moved_sphere(5), 819_240);
}

/// Casters see positions, not vertices: what a file merges makes no difference, so
/// that no ray leaves a sphere whose triangles share no vertex either.
#[test]
fn triangles_that_share_no_vertex_make_the_same_target() {
    let sphere = moved_sphere(5);
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
    let target = target(&moved_sphere(5));
    let mut random = Random::new("outside");
    for _ in 0..4 {
        let sensor = random.direction() * 3.0;
        // What faces the sensor: within 53 degrees of the line to the centre,
        // where the silhouette of a sphere seen from 3 radii is at 70.
        let facing = |p: &DVec3| p.normalize().dot(sensor) > 0.6 * 3.0;
        let points: Vec<DVec3> =
            corners_and_midpoints(&target).into_iter().filter(facing).collect();
        assert!(points.len() > 5_000);
        let (job, pattern) = aimed(&target, sensor, &points);
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
