//! Scenes whose ranges are known in closed form.

use edgepuck_mesh::TriangleMesh;
use glam::{DQuat, DVec3};
use sim_gpu::effects::Effects;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::sensor::BeamPattern;
use tests::adapter::casters;
use tests::casting::{beams, builtin, hits, job, ranges, target};
use tests::meshes::{cuboid, mapped};
use tests::random::Random;

/// Relative error of a range that is solved in f64 on a plane met at more than
/// 0.1 degree: some ten roundings of 2^-53, times the tangent of at most 573,
/// is 6e-13. Poses and rotated vertices add as much again.
const EXACT: f64 = 1e-11;

fn patterns() -> [BeamPattern; 3] {
    let mut random = Random::new("directions");
    let anywhere = beams((0..20_000).map(|_| random.direction()));
    [builtin("vlp32c"), builtin("generic-static"), anywhere]
}

/// `truth` tells the range of a beam in the world, or that it is too near a silhouette to tell.
fn check(mesh: &TriangleMesh, poses: &[Pose], truth: impl Fn(DVec3, DVec3) -> Truth) {
    let target = target(mesh);
    for pattern in &patterns() {
        for pose in poses {
            let job = job(&target, pose, pattern);
            for caster in casters(&Effects::default()) {
                let found = ranges(&hits(caster, &job, pattern), pattern);
                let mut n_unambiguous = 0;
                for (beam, (&direction, range)) in pattern.directions.iter().zip(found).enumerate()
                {
                    match (truth(pose.position_m, pose.rotation * direction), range) {
                        (Truth::Untold, _) => continue,
                        (Truth::Miss, None) => {}
                        (Truth::Within(low, high), Some(range)) => {
                            assert!((low..=high).contains(&range), "{low} <= {range} <= {high}");
                        }
                        (truth, range) => panic!("beam {beam}: {truth:?}, found {range:?}"),
                    }
                    n_unambiguous += 1;
                }
                assert!(
                    n_unambiguous * 100 > pattern.len() * 95,
                    "{n_unambiguous} of {}",
                    pattern.len()
                );
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Truth {
    Untold,
    Miss,
    Within(f64, f64),
}

impl Truth {
    fn exactly(range: f64) -> Self {
        Self::Within(range * (1.0 - EXACT), range * (1.0 + EXACT))
    }
}

fn poses(target: DVec3) -> Vec<Pose> {
    let mut random = Random::new("poses");
    [1.5, 3.0, 10.0, 50.0]
        .iter()
        .map(|&distance| {
            Pose::look_at(target + random.direction() * distance, target).expect("two places")
        })
        .collect()
}

/// Slabs: the latest entrance, the earliest exit.
fn slabs(origin: DVec3, direction: DVec3, low: DVec3, high: DVec3) -> Truth {
    let (t0, t1) = ((low - origin) / direction, (high - origin) / direction);
    let (enter, leave) = (t0.min(t1).max_element(), t0.max(t1).min_element());
    // Beside an edge the two change places: too near to tell.
    if (enter - leave).abs() < 1e-4 {
        return Truth::Untold;
    }
    match enter < leave && leave > 0.0 {
        false => Truth::Miss,
        true => Truth::exactly(if enter > 0.0 { enter } else { leave }),
    }
}

#[test]
fn a_box_wherever_it_stands_is_met_where_its_planes_are() {
    let (low, high) = (DVec3::new(-0.7, -0.4, -0.2), DVec3::new(0.7, 0.4, 0.2));
    let turned = Random::new("turn").rotation();
    for (rotation, centre) in
        [(DQuat::IDENTITY, DVec3::ZERO), (turned, DVec3::new(100.0, -50.0, 25.0))]
    {
        let mesh = mapped(&cuboid(low, high), |v| rotation * v + centre);
        let mut poses = poses(centre);
        // Inside, off its middle.
        let inside = centre + DVec3::new(0.2, 0.1, -0.05);
        poses.push(Pose::look_at(inside, centre + DVec3::X).unwrap());
        let back = rotation.inverse();
        check(&mesh, &poses, |origin, direction| {
            slabs(back * (origin - centre), back * direction, low, high)
        });
    }
}
