//! Scenes whose ranges are known in closed form.

use glam::{DQuat, DVec3};
use sim_gpu::effects::Effects;
use sim_gpu::internals::mesh::TriangleMesh;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::sensor::BeamPattern;
use tests::adapter::casters;
use tests::casting::{beams, builtin, hits, job, ranges, target};
use tests::meshes::{cuboid, icosphere, mapped};
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
                let mut told = 0;
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
                    told += 1;
                }
                assert!(told * 100 > pattern.len() * 95, "{told} of {}", pattern.len());
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

/// Where a ray enters and leaves a sphere about `centre`.
fn sphere(origin: DVec3, direction: DVec3, centre: DVec3, radius: f64) -> Option<(f64, f64)> {
    let along = (centre - origin).dot(direction);
    let off = (origin + direction * along - centre).length();
    (off < radius).then(|| {
        let half = (radius * radius - off * off).sqrt();
        (along - half, along + half)
    })
}

/// A triangle of circumradius R with its corners on the unit sphere lies inside
/// it, and nowhere deeper than radius sqrt(1 - R^2). So the range lies between
/// those of two spheres.
#[test]
fn a_sphere_lies_between_its_in_and_circumscribed_spheres() {
    let centre = DVec3::new(4.0, -2.0, 1.0);
    let ball = icosphere(5);
    let circumradius = ball
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| ball.vertices[v as usize]);
            let (ab, bc, ca) = ((b - a).length(), (c - b).length(), (a - c).length());
            ab * bc * ca / (2.0 * (b - a).cross(c - a).length())
        })
        .fold(0.0, f64::max);
    println!("the tessellation costs up to {:.1e}", 1.0 - (1.0 - circumradius.powi(2)).sqrt());
    let inner = (1.0 - circumradius * circumradius).sqrt() * (1.0 - 1e-12);
    let outer = 1.0 + 1e-12;
    let mut poses = poses(centre);
    check(&mapped(&ball, |v| v + centre), &poses, |origin, direction| {
        let ahead = |span: &(f64, f64)| span.1 > 0.0;
        match (
            sphere(origin, direction, centre, outer).filter(ahead),
            sphere(origin, direction, centre, inner).filter(ahead),
        ) {
            (None, _) => Truth::Miss,
            (_, None) => Truth::Untold,
            (Some((low, _)), Some((high, _))) => Truth::Within(low, high),
        }
    });
    poses.truncate(1);
    poses[0].position_m = centre + DVec3::new(0.3, -0.1, 0.2);
    check(&mapped(&ball, |v| v + centre), &poses, |origin, direction| {
        let range = |radius| sphere(origin, direction, centre, radius).unwrap().1;
        Truth::Within(range(inner), range(outer))
    });
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

#[test]
fn a_plane_is_met_at_its_distance_over_the_cosine() {
    let half = 20.0;
    let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
    let mesh = TriangleMesh {
        vertices: corners.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let heights = [0.5, 1.7, -3.0, 30.0];
    let poses: Vec<Pose> = heights
        .iter()
        .map(|&z| Pose { position_m: DVec3::new(0.3, -0.2, z), rotation: DQuat::IDENTITY })
        .collect();
    check(&mesh, &poses, |origin, direction| {
        let range = -origin.z / direction.z;
        let at = origin + direction * range;
        let inside = half - at.x.abs().max(at.y.abs());
        if !range.is_finite() || range < 0.0 || inside < -1e-3 {
            Truth::Miss
        } else if inside < 1e-3 || direction.z.abs() < 0.1f64.to_radians() {
            Truth::Untold
        } else {
            Truth::exactly(range)
        }
    });
}
