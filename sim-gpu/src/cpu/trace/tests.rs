use super::*;
use crate::bvh::{Builder, Stack};
use crate::cpu::traverse::traverse;
use crate::job::Culling;
use crate::lanes::run_at;
use crate::pose::Pose;
use crate::ray::RayFrame;
use crate::sensor::SensorProfile;
use crate::target::{Surface, Target};
use edgepuck_mesh::TriangleMesh;
use fearless_simd::Level;
use formats::rng::StreamKey;
use glam::{DAffine3, DVec3};

/// A torus of `2 * side * side` triangles.
fn torus(side: u32) -> Target {
    let mut mesh = TriangleMesh::default();
    let turn = |i: u32| std::f64::consts::TAU * f64::from(i) / f64::from(side);
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        let r = 1.0 + 0.4 * turn(j).cos();
        let vertex = [r * turn(i).cos(), r * turn(i).sin(), 0.4 * turn(j).sin()];
        mesh.vertices.push(DVec3::from_array(vertex));
        let at = |i: u32, j: u32| (i % side) * side + j % side;
        mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
    Target::new(Surface::of_mesh(mesh), Builder::Sah)
}

/// Two revolutions of a sensor, beside `target` and inside it.
fn revolutions(target: &Target) -> Vec<TraceRay> {
    let pattern = SensorProfile::builtin("vlp16").unwrap().pattern();
    let places = [DVec3::new(3.0, 0.4, 0.5), DVec3::new(1.0, 0.0, 0.1)];
    let aim = |place: DVec3| {
        let pose = Pose::look_at(place, DVec3::new(0.1, 0.2, 0.0)).unwrap();
        let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, &pose);
        let stream = StreamKey::new(1, "trace", 0);
        CastJob::aim(target.clone(), frame, &pattern, Culling::Off, stream, 1.0).rays().to_vec()
    };
    places.into_iter().flat_map(aim).collect()
}

/// `rays` in an order in which consecutive ones are not coherent.
fn shuffled(rays: &[TraceRay]) -> Vec<TraceRay> {
    // A prime that does not divide the number of rays, so that each comes once.
    const STEP: usize = 7919;
    assert!(!rays.len().is_multiple_of(STEP));
    (0..rays.len()).map(|i| rays[i * STEP % rays.len()]).collect()
}

/// The rays of `coherent`, some replaced by rays along axes and diagonals, without direction, and
/// with numbers that are not finite.
fn odd(coherent: &[TraceRay]) -> Vec<TraceRay> {
    let numbers = [0.0, -0.0, 1.0, -1.0, 1e-30, f32::INFINITY, f32::NAN];
    let mut rays = coherent.to_vec();
    for (i, ray) in rays.iter_mut().enumerate().filter(|(i, _)| i % 3 == 0) {
        let number = |nth: usize| numbers[i / nth % numbers.len()];
        ray.direction = [number(3), number(21), number(147)];
        if i % 2 == 0 {
            ray.origin = [number(6), number(42), number(294)];
        }
    }
    rays
}

/// The instruction sets of this processor that differ in how they trace.
fn levels() -> Vec<Level> {
    let best = Level::new();
    let mut levels = vec![best];
    #[cfg(target_arch = "x86_64")]
    {
        levels.extend(best.as_avx2().map(Level::Avx2));
        levels.extend(best.as_sse2().map(Level::Sse2));
    }
    levels
}

fn one_by_one(tree: &WideBvh, rays: &[TraceRay]) -> Vec<u32> {
    let mut stack = Stack::default();
    rays.iter().map(|ray| traverse(tree, &mut stack, ray).code()).collect()
}

#[test]
fn packets_and_interleaved_rays_answer_as_rays_one_by_one() {
    // The first tree fits a cache; the second does not, so that its rays are interleaved.
    for target in [torus(20), torus(150)] {
        let tree = &target.bvh.wide;
        let coherent = revolutions(&target);
        let sets = [coherent.clone(), shuffled(&coherent), odd(&coherent[coherent.len() - 4001..])];
        for (rays, kind) in sets.iter().zip(["coherent", "shuffled", "odd"]) {
            let expected = one_by_one(tree, rays);
            let hits = expected.iter().filter(|&&code| code != MISS).count();
            assert!(hits * 10 > rays.len(), "{hits} of {} {kind} rays hit", rays.len());
            for level in levels() {
                let mut codes = vec![0; rays.len()];
                run_at(level, Task { tree, rays, codes: &mut codes });
                let wrong = expected.iter().zip(&codes).position(|(a, b)| a != b);
                assert_eq!(wrong, None, "{level:?}, {kind}, of {} bytes", tree.bytes());
            }
            assert_eq!(trace(tree, rays), expected);
        }
    }
}

#[test]
fn a_handful_of_rays_is_traced_too() {
    let target = torus(20);
    let rays = revolutions(&target);
    for n in 0..20 {
        let rays = &rays[1000..1000 + n];
        assert_eq!(trace(&target.bvh.wide, rays), one_by_one(&target.bvh.wide, rays));
    }
}

#[test]
fn no_ray_hits_a_tree_of_nothing() {
    let nothing = Target::new(Surface::of_mesh(TriangleMesh::default()), Builder::Sah);
    let rays = revolutions(&torus(4));
    assert!(trace(&nothing.bvh.wide, &rays).iter().all(|&code| code == MISS));
}
