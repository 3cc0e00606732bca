//! What a caster does at the ends of what it may be given. Each case has its
//! asserted outcome, on the CPU twin and on the adapter.

use std::sync::Arc;

use formats::rng::StreamKey;
use glam::{DAffine3, DMat3, DQuat, DVec3, dvec3};
use sim_gpu::bvh::{Builder, assert_well_formed};
use sim_gpu::caster::Caster;
use sim_gpu::cpu::oracle;
use sim_gpu::effects::Effects;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::Mesh;
use sim_gpu::mesh::census::survey;
use sim_gpu::pose::Pose;
use sim_gpu::ray::{MISS, RayFrame};
use sim_gpu::resolve::Hits;
use sim_gpu::sensor::BeamPattern;
use sim_gpu::target::{Surface, Target};
use tests::adapter::casters;
use tests::casting::{at, beams, builtin, hits, job, job_with, target, target_by};
use tests::judge::{judge, near_silhouette};
use tests::meshes::{cube, mapped, soup, together, torus};
use tests::random::Random;

/// Casts on all casters, holds each to the oracle, and returns what all found.
fn scan(name: &str, target: &Arc<Target>, pose: &Pose, pattern: &BeamPattern) -> Vec<Hits> {
    let job = job(target, pose, pattern);
    let cast = |caster: &&Caster| {
        let hits = hits(caster, &job, pattern);
        judge(&job, pattern, &hits).assert_kept(&format!("{name} on {}", caster.name()));
        hits
    };
    casters(&Effects::default()).iter().map(cast).collect()
}

fn view(scale: f64, centre: DVec3) -> Pose {
    Pose::view(3.0 * scale, 20f64.to_radians(), 0.3, centre)
}

fn straight() -> BeamPattern {
    beams([DVec3::X])
}

#[test]
fn a_scan_is_the_same_at_every_scale() {
    let pattern = builtin("vlp32c");
    let mesh = torus(60);
    let reference = scan("scale 1", &target(&mesh), &view(1.0, DVec3::ZERO), &pattern);
    for scale in [1e-30, 1e-12, 1e-6, 1e-3, 1e3, 1e6, 1e12, 1e30] {
        let scaled = target(&mapped(&mesh, |v| v * scale));
        let found = scan(&format!("scale {scale}"), &scaled, &view(scale, DVec3::ZERO), &pattern);
        for (reference, found) in reference.iter().zip(&found) {
            assert_eq!(reference.hits.len(), found.hits.len(), "scale {scale}");
            for (one, other) in reference.hits.iter().zip(&found.hits) {
                assert_eq!((one.beam, one.triangle), (other.beam, other.triangle));
                // Vertices and sensor round to 2^-53 of their own size, which
                // slopes of up to 10^3 amplify.
                let error = (other.range_m / scale / one.range_m - 1.0).abs();
                assert!(error < 1e-12, "scale {scale}: {error:e}");
            }
        }
    }
}

#[test]
fn a_scan_is_the_same_to_a_micrometre_wherever_it_is() {
    let pattern = builtin("vlp32c");
    let mesh = torus(60);
    let at_home = target(&mesh);
    let home = view(1.0, DVec3::ZERO);
    let home_job = job(&at_home, &home, &pattern);
    let reference = scan("at home", &at_home, &home, &pattern);
    for offset in [DVec3::X * 1e3, dvec3(1e5, -1e5, 1e5), dvec3(-1e7, 1e7, 1e7)] {
        let moved = target(&mapped(&mesh, |v| v + offset));
        let pose = Pose { position_m: home.position_m + offset, ..home };
        let found = scan(&format!("offset {offset}"), &moved, &pose, &pattern);
        for (reference, found) in reference.iter().zip(&found) {
            let mut ranges = vec![[None; 2]; pattern.len()];
            for (side, hits) in [reference, found].into_iter().enumerate() {
                hits.hits.iter().for_each(|h| ranges[h.beam as usize][side] = Some(h.range_m));
            }
            let mut differing = 0;
            for (beam, [here, there]) in ranges.into_iter().enumerate() {
                let same = match (here, there) {
                    (Some(here), Some(there)) => (here - there).abs() < 1e-6,
                    (here, there) => here.is_none() && there.is_none(),
                };
                if !same {
                    // At 1e7 m f64 itself has steps of 2e-9 m.
                    let ray = home_job.frame.ray(pattern.directions[beam]);
                    let truth = oracle::nearest(&at_home, &ray);
                    assert!(near_silhouette(&at_home, &ray, truth), "{here:?}, {there:?}");
                    differing += 1;
                }
            }
            assert!(differing <= 2, "{differing} beams at silhouettes");
        }
    }
}

/// A scene with the range that each of its beams must find.
struct Case {
    name: &'static str,
    mesh: Mesh,
    pose: Pose,
    beams: BeamPattern,
    /// Per beam; `None` is no hit.
    ranges: Vec<Option<f64>>,
}

impl Case {
    fn new(name: &'static str, mesh: Mesh, sensor: DVec3, aims: &[(DVec3, Option<f64>)]) -> Self {
        Self {
            name,
            mesh,
            pose: at(sensor),
            beams: beams(aims.iter().map(|aim| aim.0)),
            ranges: aims.iter().map(|aim| aim.1).collect(),
        }
    }

    fn all(
        name: &'static str,
        mesh: Mesh,
        sensor: DVec3,
        range: impl Fn(DVec3) -> Option<f64>,
    ) -> Self {
        let mut random = Random::new(name);
        let aims: Vec<_> = (0..2000).map(|_| random.direction()).map(|d| (d, range(d))).collect();
        Self::new(name, mesh, sensor, &aims)
    }

    fn check(&self) {
        let target = target(&self.mesh);
        for hits in scan(self.name, &target, &self.pose, &self.beams) {
            let mut found = vec![None; self.beams.len()];
            hits.hits.iter().for_each(|h| found[h.beam as usize] = Some(h.range_m));
            for (beam, (found, expected)) in found.iter().zip(&self.ranges).enumerate() {
                let same = match (found, expected) {
                    // Exact to some roundings, amplified by at most 10^3.
                    (Some(found), Some(expected)) => (found - expected).abs() <= 1e-12 * expected,
                    (found, expected) => found == expected,
                };
                assert!(same, "{}, beam {beam}: {found:?} is not {expected:?}", self.name);
            }
        }
    }
}

fn triangle(a: DVec3, b: DVec3, c: DVec3) -> Mesh {
    Mesh { vertices: vec![a, b, c], triangles: vec![[0, 1, 2]] }
}

fn square() -> Mesh {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let vertices = corners.map(|(x, y)| dvec3(x, y, 0.0)).to_vec();
    Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
}

/// Where a ray from within leaves the cube.
fn leaves_cube(from: DVec3, direction: DVec3) -> f64 {
    ((direction.signum() - from) / direction).min_element()
}

fn cases() -> Vec<Case> {
    let down = -DVec3::Z;
    // Slivers of 2 by 2e-6 from one apex; beams at their sides and between.
    let tips = 501;
    let tip = |i: f64| dvec3(1.0, (i - 250.0) * 2e-6, 0.0);
    let fan = Mesh {
        vertices: (0..tips).map(|i| tip(f64::from(i))).chain([-DVec3::X]).collect(),
        triangles: (0..tips - 1).map(|i| [tips, i, i + 1]).collect(),
    };
    let over_fan = dvec3(0.3, 0.0, 2.0);
    let at_fan: Vec<_> = (1..2 * tips - 3)
        .map(|half| tip(f64::from(half) * 0.5) * 0.5 - over_fan)
        .map(|aim| (aim, Some(aim.length())))
        .collect();
    // Squares that overlap in a plane, none alike.
    let turned =
        |angle: f64, size: f64| mapped(&square(), |v| DQuat::from_rotation_z(angle) * v * size);
    let layers = together(&[square(), turned(0.4, 0.9), turned(1.1, 0.8), turned(0.0, 0.5)]);
    let over_layers = dvec3(0.1, 0.2, 3.0);
    let mut random = Random::new("layers");
    let at_layers: Vec<_> = (0..2000)
        .map(|_| random.in_cube().with_z(0.0) * 0.99 - over_layers)
        .map(|aim| (aim, Some(aim.length())))
        .collect();
    let inside = dvec3(0.25, -0.5, 0.125);
    let far = dvec3(-2e6, 0.0, 0.0);
    let at_far: Vec<_> = (0..2000)
        .map(|_| (random.in_cube() * 0.9).with_x(-1.0) - far)
        .map(|aim| (aim, Some(aim.length())))
        .collect();
    let degenerate = together(&[
        triangle(DVec3::ZERO, DVec3::X, DVec3::X * 2.0),
        triangle(DVec3::Y, DVec3::Y, DVec3::Z),
        triangle(DVec3::ONE, DVec3::ONE, DVec3::ONE),
    ]);
    vec![
        Case::new(
            "one triangle",
            triangle(DVec3::ZERO, DVec3::X, DVec3::Y),
            dvec3(0.25, 0.25, 1.0),
            &[(down, Some(1.0)), (DVec3::Z, None), (dvec3(1.0, 1.0, -1.0), None)],
        ),
        Case::new(
            "a triangle's corners and edges",
            triangle(DVec3::ZERO, DVec3::X, DVec3::Y),
            DVec3::Z,
            &[(down, Some(1.0)), (dvec3(0.5, 0.0, -1.0), Some(1.25f64.sqrt()))],
        ),
        Case::all("no triangle at all", Mesh::default(), DVec3::Z, |_| None),
        Case::all("degenerate triangles alone", degenerate, DVec3::Z, |_| None),
        Case::new("slivers of aspect 1e6", fan, over_fan, &at_fan),
        Case::new("overlapping layers of one plane", layers, over_layers, &at_layers),
        Case::all("inside a cube", cube(), inside, |d| Some(leaves_cube(inside, d))),
        Case::new(
            "within a plane, along it",
            square(),
            dvec3(-3.0, 0.25, 0.0),
            &[(DVec3::X, None), (dvec3(1.0, 0.1, 0.0), None), (-DVec3::X, None)],
        ),
        Case::new(
            "along a face of a cube, onto the edge before it",
            cube(),
            dvec3(-3.0, 0.25, 1.0),
            &[(DVec3::X, Some(2.0)), (dvec3(2.0, 0.5, 0.0), Some(4.25f64.sqrt()))],
        ),
        Case::new("from a million cubes away", cube(), far, &at_far),
    ]
}

#[test]
fn extreme_scenes_have_their_known_ranges() {
    for case in cases() {
        case.check();
    }
}

/// Which side of a surface a sensor on it stands on is a matter of the last
/// bit, beam by beam: it is blind, or looks past the surface. At range 0 no
/// angle is small, so the judge of other tests has no say; on an edge, f32 and
/// f64 may choose differently.
#[test]
fn a_sensor_on_a_surface_is_blind_or_looks_past_it() {
    let cube = target(&cube());
    let mut random = Random::new("on a surface");
    let pattern = beams((0..2000).map(|_| random.direction()));
    for place in [dvec3(0.3, 0.2, 1.0), dvec3(0.3, 1.0, 1.0), DVec3::ONE] {
        let job = job(&cube, &at(place), &pattern);
        for caster in casters(&Effects::default()) {
            let mut ranges = vec![None; pattern.len()];
            let found = hits(caster, &job, &pattern);
            found.hits.iter().for_each(|h| ranges[h.beam as usize] = Some(h.range_m));
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

/// Trees of one leaf have an empty child: it must not be met.
#[test]
fn few_triangles_leave_f64_nothing_to_decide() {
    let pattern = beams([dvec3(0.1, 0.05, -1.0), dvec3(-0.2, 0.1, -1.0), dvec3(0.3, -0.5, -1.0)]);
    for mesh in [square(), triangle(dvec3(-1.0, -1.0, 0.0), DVec3::X, DVec3::Y)] {
        for hits in scan("few", &target(&mesh), &at(dvec3(0.0, 0.0, 0.5)), &pattern) {
            assert_eq!((hits.hits.len(), hits.decided_in_f64), (3, 0));
        }
    }
}

/// An object without triangles beside others, in one batch: uncast it would
/// be tried at no cost, and cast it must not borrow its neighbours' triangles.
#[test]
fn an_empty_object_in_a_batch_has_no_hits() {
    let pattern = builtin("generic-static");
    let [empty, full] = [Mesh::default(), torus(20)].map(|mesh| target(&mesh));
    let pose = view(1.0, DVec3::ZERO);
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

#[test]
fn a_sensor_straight_above_or_below_sees_the_middle() {
    let cube = target(&cube());
    for elevation in [90f64, -90.0] {
        for azimuth in [0.0, 1.0, 3.0] {
            let pose = Pose::view(3.0, elevation.to_radians(), azimuth, DVec3::ZERO);
            for hits in scan("poles", &cube, &pose, &straight()) {
                assert_eq!(hits.hits.len(), 1);
                assert!((hits.hits[0].range_m - 2.0).abs() < 1e-12);
            }
            let pattern = builtin("vlp32c");
            let counts = scan("poles", &cube, &pose, &pattern);
            assert!(counts.iter().all(|hits| hits.hits.len() > 1000));
        }
    }
}

#[test]
fn a_million_triangles_make_sound_trees_and_equal_hits() {
    let mesh = torus(707);
    let pattern = builtin("vlp32c");
    let scans = [Builder::Sah, Builder::Morton].map(|builder| {
        let target = target_by(builder, &mesh);
        assert_eq!(target.surface.len(), 999_698);
        assert_well_formed(&target.bvh);
        scan("a million", &target, &view(1.0, DVec3::ZERO), &pattern)
    });
    for hits in scans.iter().flatten() {
        assert_eq!(hits.hits, scans[0][0].hits);
        assert!(hits.hits.len() > 2000);
    }
}

/// A pose that is no pose sees nothing, and does not hang.
#[test]
fn a_sensor_nowhere_sees_nothing() {
    let target = target(&torus(20));
    let mut random = Random::new("nowhere");
    let pattern = beams((0..1000).map(|_| random.direction()));
    let poses = [
        at(DVec3::NAN),
        at(dvec3(0.0, f64::NAN, 0.0)),
        at(DVec3::INFINITY),
        at(dvec3(f64::NEG_INFINITY, 0.0, 0.0)),
        at(DVec3::splat(f64::MAX)),
        Pose {
            position_m: DVec3::X * 3.0,
            world_from_sensor: DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0),
        },
        Pose {
            position_m: DVec3::X * 3.0,
            world_from_sensor: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0) * f64::NAN,
        },
    ];
    for pose in &poses {
        for culling in [Culling::On, Culling::Off] {
            let job = job_with(&target, pose, &pattern, culling);
            for caster in casters(&Effects::default()) {
                let hits = hits(caster, &job, &pattern);
                assert!(hits.hits.is_empty(), "{pose:?}, {culling:?} on {}", caster.name());
            }
        }
    }
}

/// Every triangle of `mesh` is kept, whatever a survey says.
fn unsurveyed(mesh: Mesh) -> Arc<Target> {
    let kept = (0..mesh.triangles.len() as u32).collect();
    Arc::new(Target::new(Surface::new(mesh, kept), Builder::Sah))
}

/// Coincident triangles, near enough for f64 to be asked and far enough for
/// f32 to answer by itself.
#[test]
fn of_coincident_triangles_the_lowest_index_is_hit() {
    let single = soup(50, 1.0);
    let copies = |order: [[usize; 3]; 3]| {
        let turn = |p: [usize; 3]| {
            let triangles = single.triangles.iter().map(|t| p.map(|i| t[i])).collect();
            Mesh { vertices: single.vertices.clone(), triangles }
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
            assert_eq!(survey(&copies(orders)).census.duplicate, 100);
        }
    }
}

/// An object that its scene squeezes, against the squeezed mesh.
#[test]
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
        let pose = view(1.0, world_from_object.translation);
        let truth = scan("baked", &baked, &pose, &pattern);
        let plain = target(&mesh);
        let frame = RayFrame::new(&plain.surface, &world_from_object, &pose);
        for culling in [Culling::On, Culling::Off] {
            let stream = StreamKey::new(0, "", 0);
            let job = CastJob::aim(Arc::clone(&plain), frame, &pattern, culling, stream, 1.0);
            for caster in casters(&Effects::default()) {
                let found = hits(caster, &job, &pattern);
                judge(&job, &pattern, &found).assert_kept("squeezed");
                let mut ranges = vec![[None; 2]; pattern.len()];
                for (side, hits) in [&truth[0], &found].into_iter().enumerate() {
                    hits.hits.iter().for_each(|h| ranges[h.beam as usize][side] = Some(h.range_m));
                }
                let differing = ranges.iter().filter(|pair| match pair {
                    // The squeeze's inverse amplifies roundings by 10^3.
                    [Some(a), Some(b)] => (a - b).abs() > 1e-9,
                    [a, b] => a.is_some() != b.is_some(),
                });
                assert!(differing.count() <= 2);
            }
        }
    }
}

#[test]
fn an_object_flattened_to_nothing_is_not_seen() {
    let target = target(&torus(20));
    let pattern = builtin("vlp32c");
    for stretch in [dvec3(1.0, 1.0, 0.0), DVec3::ZERO, DVec3::NAN] {
        let flat = DAffine3::from_scale(stretch);
        let frame = RayFrame::new(&target.surface, &flat, &view(1.0, DVec3::ZERO));
        let stream = StreamKey::new(0, "", 0);
        for culling in [Culling::On, Culling::Off] {
            let job = CastJob::aim(Arc::clone(&target), frame, &pattern, culling, stream, 1.0);
            for caster in casters(&Effects::default()) {
                assert!(hits(caster, &job, &pattern).hits.is_empty(), "{stretch}");
            }
        }
    }
}
