//! Relations between several scans, which the table of one case cannot express.

use edgepuck_mesh::TriangleMesh;
use edgepuck_mesh::validate::triangle_stats;
use glam::{DAffine3, DMat3, DVec3, dvec3};
use libtest_mimic::Trial;
use sim_gpu::effects::Effects;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::cpu::oracle;
use sim_gpu::internals::job::Culling;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::ray::MISS;
use sim_gpu::internals::resolve::Hits;
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::{Surface, Target};
use tests::adapter::casters;
use tests::casting::{at, beams, builtin, hits, job, job_with, placed_job, ranges, target};
use tests::judge::judge;
use tests::meshes::{cube, mapped, soup, together, torus};
use tests::random::Random;

use crate::chain::a_chair_far_away_and_noisy_is_classified_as_at_the_origin;

macro_rules! trials {
    ($($rule:path),* $(,)?) => {
        vec![$(Trial::test(stringify!($rule), || {
            $rule();
            Ok(())
        })),*]
    };
}

pub fn trials() -> Vec<Trial> {
    trials![
        a_sensor_on_a_surface_is_blind_or_looks_past_it,
        an_empty_object_in_a_batch_has_no_hits,
        lowest_index_of_coincident_triangles_is_hit,
        a_squeezed_object_is_seen_as_its_squeezed_mesh,
        an_object_flattened_to_nothing_is_not_seen,
        a_chair_far_away_and_noisy_is_classified_as_at_the_origin,
    ]
}

/// Casts with all casters, compares each with the oracle, and returns the common result.
fn scan(name: &str, target: &Target, pose: &Pose, pattern: &BeamPattern) -> Vec<Hits> {
    let job = job(target, pose, pattern);
    let cast = |caster: &&OpenCaster| {
        let hits = hits(caster, &job, pattern);
        judge(&job, pattern, &hits).assert_kept(&format!("{name} on {}", caster.name()));
        hits
    };
    casters(&Effects::default()).iter().map(cast).collect()
}

fn view(centre: DVec3) -> Pose {
    Pose::view(3.0, 20f64.to_radians(), 0.3, centre)
}

/// The point at which a ray from within leaves the cube.
fn leaves_cube(from: DVec3, direction: DVec3) -> f64 {
    ((direction.signum() - from) / direction).min_element()
}

/// The last bit decides for each beam on which side of the surface the sensor is: the beam sees
/// nothing, or passes the surface. At range 0, no angle is small, so that the oracle of other tests
/// does not apply; on an edge, f32 and f64 may choose differently.
fn a_sensor_on_a_surface_is_blind_or_looks_past_it() {
    let cube = target(&cube());
    let mut random = Random::new("on a surface");
    let pattern = beams((0..2000).map(|_| random.direction()));
    for place in [dvec3(0.3, 0.2, 1.0), dvec3(0.3, 1.0, 1.0), DVec3::ONE] {
        let job = job(&cube, &at(place), &pattern);
        for caster in casters(&Effects::default()) {
            let ranges = ranges(&hits(caster, &job, &pattern), &pattern);
            let (mut blind, mut differing) = (0, 0);
            for (&direction, range) in pattern.directions.iter().zip(ranges) {
                let is_blind = |range: f64| range < 1e-15;
                let past = leaves_cube(place, direction);
                match range {
                    Some(range) if is_blind(range) => blind += 1,
                    Some(range) => assert!((range / past - 1.0).abs() < 1e-12, "{range}"),
                    None => assert!(past < 1e-15, "{direction} ends within the cube at {past}"),
                }
                let truth = oracle::nearest(&cube, &job.frame.ray(direction)).map(|c| c.range_m);
                differing +=
                    usize::from(truth.is_some_and(is_blind) != range.is_some_and(is_blind));
            }
            println!("{place} on {}: {blind} blind, {differing} unlike f64", caster.name());
            assert!(blind > 200);
            let is_on_edge = place.abs().to_array().iter().filter(|c| **c == 1.0).count() > 1;
            assert!(differing == 0 || is_on_edge, "{differing} at {place}");
        }
    }
}

fn an_empty_object_in_a_batch_has_no_hits() {
    let pattern = builtin("generic-static");
    let [empty, full] = [TriangleMesh::default(), torus(20)].map(|mesh| target(&mesh));
    let pose = view(DVec3::ZERO);
    let cast = |target| job_with(target, &pose, &pattern, Culling::Off);
    let jobs = [cast(&empty), cast(&full), cast(&empty)];
    for caster in casters(&Effects::default()) {
        for jobs in [&jobs[..], &jobs[1..], &jobs[2..], &jobs[..2]] {
            for (job, cast) in jobs.iter().zip(caster.cast(jobs).unwrap()) {
                let missed = cast.codes.iter().all(|&code| code == MISS);
                assert_eq!(missed, job.target.surface.is_empty(), "{}", caster.name());
            }
        }
    }
}

/// Keeps all triangles of `mesh`, regardless of the survey.
fn unsurveyed(mesh: TriangleMesh) -> Target {
    let kept = (0..mesh.triangles.len() as u32).collect();
    Target::new(Surface::new(mesh, kept), Builder::Sah)
}

/// Coincident triangles, both so near that f64 decides and so far that f32 decides.
fn lowest_index_of_coincident_triangles_is_hit() {
    let single = soup(50, 1.0);
    let copies = |order: [[usize; 3]; 3]| {
        let turn = |p: [usize; 3]| {
            let triangles = single.triangles.iter().map(|t| p.map(|i| t[i])).collect();
            TriangleMesh { vertices: single.vertices.clone(), triangles }
        };
        together(&order.map(turn))
    };
    let all_orders = [
        ("winding turned", [[0, 1, 2], [0, 2, 1], [2, 1, 0]]),
        ("corners turned", [[1, 2, 0], [0, 1, 2], [2, 0, 1]]),
    ];
    let mut random = Random::new("coincident");
    for (name, orders) in all_orders {
        for distance in [2.0, 10.0, 300.0] {
            let sensor = random.direction() * distance;
            let pattern = beams((0..3000).map(|_| random.in_cube() - sensor));
            let alone = scan(name, &target(&single), &at(sensor), &pattern);
            let kept_all = scan(name, &unsurveyed(copies(orders)), &at(sensor), &pattern);
            let surveyed = scan(name, &target(&copies(orders)), &at(sensor), &pattern);
            for hits in kept_all.iter().chain(&surveyed) {
                assert_eq!(hits.hits, alone[0].hits, "{name} at {distance}");
            }
            assert!(alone[0].hits.len() > 1000);
            assert_eq!(triangle_stats(&copies(orders)).defects.duplicate, 100);
        }
    }
}

fn a_squeezed_object_is_seen_as_its_squeezed_mesh() {
    let mesh = torus(40);
    let pattern = builtin("vlp32c");
    let turn = DMat3::from_quat(Random::new("squeeze").rotation());
    for stretch in [dvec3(1.0, 2.0, 0.5), dvec3(1.0, 1.0, 1e-3), dvec3(-1.0, 1.0, 1.0)] {
        let world_from_object = DAffine3::from_mat3_translation(
            DMat3::from_diagonal(stretch) * turn,
            dvec3(5.0, -3.0, 1.0),
        );
        let baked = target(&mapped(&mesh, |v| world_from_object.transform_point3(v)));
        let pose = view(world_from_object.translation);
        let truth = scan("baked", &baked, &pose, &pattern);
        let truth = ranges(&truth[0], &pattern);
        let plain = target(&mesh);
        for culling in [Culling::On, Culling::Off] {
            let job = placed_job(&plain, &world_from_object, &pose, &pattern, culling);
            for caster in casters(&Effects::default()) {
                let found = hits(caster, &job, &pattern);
                judge(&job, &pattern, &found).assert_kept("squeezed");
                let found = ranges(&found, &pattern);
                let differing = truth.iter().zip(&found).filter(|pair| match pair {
                    // The inverse of the scale amplifies roundings by 10^3.
                    (Some(a), Some(b)) => (a - b).abs() > 1e-9,
                    (a, b) => a.is_some() != b.is_some(),
                });
                assert!(differing.count() <= 2);
            }
        }
    }
}

fn an_object_flattened_to_nothing_is_not_seen() {
    let target = target(&torus(20));
    let pattern = builtin("vlp32c");
    for stretch in [dvec3(1.0, 1.0, 0.0), DVec3::ZERO, DVec3::NAN] {
        let flat = DAffine3::from_scale(stretch);
        for culling in [Culling::On, Culling::Off] {
            let job = placed_job(&target, &flat, &view(DVec3::ZERO), &pattern, culling);
            for caster in casters(&Effects::default()) {
                assert!(hits(caster, &job, &pattern).hits.is_empty(), "{stretch}");
            }
        }
    }
}
