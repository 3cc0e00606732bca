//! Tracing on every caster against the f64 oracle, and casters against each
//! other: `shaders/{trace,traverse,intersect}.wgsl` and their twins in
//! `sim-gpu/src/cpu`.

use edgepuck_mesh::TriangleMesh;
use glam::DVec3;
use sim_gpu::effects::Effects;
use sim_gpu::internals::cpu::oracle;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::ray::{AMBIGUOUS, MISS};
use sim_gpu::internals::resolve::resolve;
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::Target;
use test_support::need;
use tests::adapter::{adapter, casters};
use tests::adversarial::{aimed, corners_and_midpoints};
use tests::casting::{at, beams, builtin, cast, hits, job, target};
use tests::judge::{MOST_AMBIGUOUS, Verdict, assert_promise, judge, leaves_too_much};
use tests::meshes::{cube, icosphere, soup, together, torus};
use tests::random::Random;

fn surfaces() -> Vec<(&'static str, TriangleMesh)> {
    let room = tests::meshes::cuboid(DVec3::splat(-8.0), DVec3::splat(8.0));
    vec![
        ("sphere", icosphere(4)),
        ("cube", cube()),
        ("torus", torus(71)),
        ("torus in a room", together(&[torus(71), room])),
        ("soup", soup(2000, 0.2)),
        ("crossing sheets", soup(20, 1.0)),
    ]
}

fn poses() -> Vec<Pose> {
    let from = [DVec3::new(5.0, 0.0, 0.5), DVec3::new(1.2, 1.1, 1.3), DVec3::new(0.1, -0.2, 0.05)];
    from.iter().map(|&p| Pose::look_at(p, DVec3::ZERO).expect("two places")).collect()
}

fn for_all_jobs(mut check: impl FnMut(&str, &Target, &Pose, &BeamPattern)) {
    let sensors = ["vlp32c", "generic-static"].map(builtin);
    for (name, mesh) in surfaces() {
        let target = target(&mesh);
        for pose in &poses() {
            for pattern in &sensors {
                check(name, &target, pose, pattern);
            }
        }
    }
}

/// A caster that leaves every ray to f64 keeps every promise: it has to fail by the share.
#[test]
fn a_caster_that_marks_every_ray_is_found_out() {
    let pattern = builtin("generic-static");
    let job = job(&target(&cube()), &at(DVec3::new(0.1, 0.2, 0.3)), &pattern);
    let mut cast = cast(casters(&Effects::default())[0], &job);
    cast.codes.iter_mut().filter(|code| **code != MISS).for_each(|code| *code |= AMBIGUOUS);
    let hits = resolve(&job, &cast, &pattern, &Effects::default());
    judge(&job, &pattern, &hits).assert_kept("all rays marked");
    assert!(leaves_too_much(&hits, MOST_AMBIGUOUS));
}

#[test]
fn every_caster_keeps_the_promise() {
    for caster in casters(&Effects::default()) {
        let mut all = Verdict::default();
        for_all_jobs(|name, target, pose, pattern| {
            let job = job(target, pose, pattern);
            let verdict = assert_promise(caster, &job, pattern, MOST_AMBIGUOUS, name);
            all = std::mem::take(&mut all).and(verdict);
        });
        println!("{}: {all}", caster.name());
        assert!(all.hits > 100_000);
        // Ranges are solved in f64 on the triangle found, by the plane here and
        // by edge functions there. Both amplify roundings of 2^-53 by the
        // tangent of the incidence, at most 573, and by the ratio of the
        // distance to a triangle's height, here at most 2^8.
        assert!(all.worst < 1e-10);
    }
}

/// A beam within the rounding of f32 of a fold may be judged on the wrong side of
/// it, and the planes of both part at the tangent of the incidence.
#[test]
fn beams_aimed_at_sharp_edges_keep_the_promise() {
    let mut random = Random::new("sharp edges");
    let target = target(&cube());
    for caster in casters(&Effects::default()) {
        let mut all = Verdict::default();
        for _ in 0..40 {
            // Close above one face's plane, from 0.1 degree up.
            let aside = random.direction().with_z(0.0) * 3.0;
            let sensor = aside.with_z(1.0 + 0.005 + 0.1 * random.unit());
            let points = (0..2000).map(|_| {
                let along = random.unit() * 2.0 - 1.0;
                let off = (random.unit() - 0.5) * 1e-5;
                let edge = if aside.x.abs() > aside.y.abs() {
                    DVec3::new(aside.x.signum(), along, 1.0 + off)
                } else {
                    DVec3::new(along, aside.y.signum(), 1.0 + off)
                };
                edge - sensor
            });
            let pattern = beams(points.collect::<Vec<_>>());
            let job = job(&target, &at(sensor), &pattern);
            all = all.and(judge(&job, &pattern, &hits(caster, &job, &pattern)));
        }
        println!("{}: {all}", caster.name());
        all.assert_kept(caster.name());
    }
}

/// They round otherwise: the adapter makes its rays in integers, and WGSL leaves divisions and fusion open. Where that
/// matters f64 decides, so that hits are equal to the bit.
#[test]
fn the_adapter_finds_what_its_twin_finds() {
    let plain = Effects::default();
    let gpu = need!(adapter(&plain));
    let cpu = casters(&plain)[0];
    for_all_jobs(|name, target, pose, pattern| {
        let job = job(target, pose, pattern);
        let [on_cpu, on_gpu] = [cpu, gpu].map(|caster| hits(caster, &job, pattern));
        assert_eq!(on_cpu.hits, on_gpu.hits, "{name}");
    });
}

/// Where a triangle ends and no other goes on, f32 alone may tell a hit as a miss.
#[test]
fn beams_aimed_at_free_borders_find_what_f64_finds() {
    let target = target(&soup(500, 0.2));
    let points = corners_and_midpoints(&target);
    let mut random = Random::new("free borders");
    for distance in [0.3, 0.6, 1.5, 5.0, 100.0, 1000.0] {
        let (job, pattern) = aimed(&target, random.direction() * distance, &points);
        let nearest = |beam| {
            let nearest = oracle::nearest(&target, &job.frame.beam(&pattern, beam))?;
            Some((beam, nearest.index))
        };
        let expected: Vec<(u32, u32)> = (0..pattern.len() as u32).filter_map(nearest).collect();
        for caster in casters(&Effects::default()) {
            let found = hits(caster, &job, &pattern).hits;
            let found: Vec<(u32, u32)> = found.iter().map(|hit| (hit.beam, hit.triangle)).collect();
            assert_eq!(found, expected, "{distance} on {}", caster.name());
        }
    }
}

#[test]
fn jobs_answer_alike_cast_together_alone_and_while_others_are_in_flight() {
    let mut jobs = Vec::new();
    for_all_jobs(|_, target, pose, pattern| jobs.push(job(target, pose, pattern)));
    for caster in casters(&Effects::default()) {
        let expected = caster.cast(&jobs).unwrap();
        assert_eq!(expected.len(), jobs.len());
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let (jobs, expected) = (&jobs, &expected);
                scope.spawn(move || {
                    for i in (0..jobs.len()).cycle().skip(thread * 7).take(3 * jobs.len()) {
                        let first = caster.submit(&jobs[i..=i]).unwrap();
                        let next = (i + 1) % jobs.len();
                        let second = caster.submit(&jobs[next..=next]).unwrap();
                        assert_eq!(second.wait().unwrap()[0], expected[next], "job {next}");
                        assert_eq!(first.wait().unwrap()[0], expected[i], "job {i}");
                    }
                });
            }
        });
        assert!(caster.cast(&[]).unwrap().is_empty());
    }
}
