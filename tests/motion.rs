//! Sensors and objects that move during a scan, against scans of a world that stands still, one
//! firing after the other, and against closed forms.

use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::{DAffine3, DQuat, DVec3};
use sim_gpu::effects::{Effects, Weather};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::job::Culling;
use sim_gpu::internals::pose::{Pose, Trajectory};
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, scan_objects};
use sim_gpu::internals::sensor::{BeamPattern, Layout, Rotating, SensorProfile};
use sim_gpu::internals::target::Target;
use std::num::NonZeroU32;
use std::sync::Arc;
use tests::{adapter, casting, meshes};

/// The time of the trajectories at which scans begin: in Unix time, microseconds of which f32
/// does not hold.
const START_S: f64 = 1.7e9;

fn pose(position_m: [f64; 3], axis: DVec3, angle_rad: f64) -> Pose {
    let rotation = DQuat::from_axis_angle(axis.normalize(), angle_rad);
    Pose { position_m: position_m.into(), rotation }
}

fn moving(poses: &[(f64, Pose)]) -> Option<Arc<Trajectory>> {
    let poses = poses.iter().map(|(after_s, pose)| (START_S + after_s, *pose)).collect();
    Some(Arc::new(Trajectory::new(poses).unwrap()))
}

/// A sensor that swerves, and goes on as it did after a jump.
fn swerving() -> Option<Arc<Trajectory>> {
    moving(&[
        (-1.0, pose([0.0, -1.0, 0.2], DVec3::Z, 0.0)),
        (0.03, pose([0.5, 0.3, 0.2], DVec3::Z, 0.3)),
        (0.06, pose([0.6, 0.1, 0.3], DVec3::new(0.1, 0.2, 1.0), 0.5)),
        (0.0601, pose([1.0, 0.1, 0.3], DVec3::Z, -0.5)),
        (0.2, pose([2.0, 0.4, 0.0], DVec3::Z, 0.2)),
    ])
}

fn passing() -> Option<Arc<Trajectory>> {
    moving(&[
        (0.0, pose([4.0, -1.0, 0.0], DVec3::Z, 0.0)),
        (0.1, pose([4.0, 3.0, 0.5], DVec3::new(0.3, 0.1, 1.0), 2.0)),
    ])
}

fn sensor() -> SensorProfile {
    SensorProfile::builtin("vlp32c").unwrap().decimated(NonZeroU32::new(12).unwrap())
}

fn everything() -> std::collections::BTreeSet<Attribute> {
    Attribute::ALL.into_iter().filter(|of| *of != Attribute::Intensity).collect()
}

fn targets() -> [Target; 2] {
    let lump = meshes::mapped(&meshes::icosphere(3), |p| p * DVec3::new(1.0, 0.6, 0.8));
    [meshes::cuboid(DVec3::splat(-9.0), DVec3::splat(9.0)), lump].map(|mesh| casting::target(&mesh))
}

fn request<'a>(sensor: &'a SensorProfile, pattern: &'a BeamPattern) -> ScanRequest<'a> {
    let mut request = ScanRequest::new(sensor, pattern, pose([0.0; 3], DVec3::Z, 0.0));
    request.attributes = everything();
    (request.stream, request.start_s) = (StreamKey([3, 5]), START_S);
    request
}

#[test]
fn a_scan_in_motion_is_a_loop_of_scans_of_a_world_that_stands_still() {
    let (sensor, targets) = (sensor(), targets());
    let pattern = sensor.pattern();
    let stretched = DAffine3::from_scale(DVec3::new(1.0, 1.3, 0.7));
    for caster in adapter::casters(&Effects::default()) {
        let mut request = request(&sensor, &pattern);
        (request.motion, request.deskew) = (swerving(), true);
        let mut placed = [PlacedTarget::new(&targets[0]), PlacedTarget::new(&targets[1])];
        (placed[1].motion, placed[1].world_from_object) = (passing(), stretched);
        let scan = scan_objects(caster, &placed, &request).unwrap().scan;
        assert_eq!(scan.len(), pattern.len(), "the room has no gaps");
        let on_lump = scan.object.as_ref().unwrap().iter().filter(|&&object| object == 1).count();
        assert!(on_lump > 30, "{on_lump}");

        // The pattern's own times, and one frozen scan for each that there is.
        let mut times_s = pattern.time_s.clone();
        times_s.dedup();
        let mut frozen = placed.clone();
        frozen.iter_mut().for_each(|placed| placed.motion = None);
        for time_s in times_s.into_iter().step_by(17) {
            let beams: Vec<usize> =
                (0..pattern.len()).filter(|&i| pattern.time_s[i] == time_s).collect();
            let part = BeamPattern::new(
                beams.iter().map(|&i| pattern.directions[i]).collect(),
                beams.iter().map(|&i| pattern.ring[i]).collect(),
                vec![time_s; beams.len()],
            );
            let mut still = request.clone();
            (still.pattern, still.motion) = (&part, None);
            still.pose = swerving().unwrap().at(START_S + time_s);
            let body = passing().unwrap().at(START_S + time_s);
            frozen[1].world_from_object =
                DAffine3::from_rotation_translation(body.rotation, body.position_m) * stretched;
            let mut expected = scan_objects(caster, &frozen, &still).unwrap().scan;
            expected
                .beam
                .iter_mut()
                .flatten()
                .for_each(|beam| *beam = beams[*beam as usize] as u32);
            assert_eq!(expected.origin, scan.origin);
            assert_eq!(scan.select(&beams), expected, "{}, {time_s} s", caster.name());
        }
    }
}

#[test]
fn culling_loses_nothing_of_what_moves() {
    let (sensor, [_, lump]) = (sensor(), targets());
    let pattern = sensor.pattern();
    let seen = |of_sensor: Option<Arc<Trajectory>>, target: &Target, x_m: f64, of_car| -> Scan {
        let [culled, all] = [Culling::On, Culling::Off].map(|culling| {
            let mut request = request(&sensor, &pattern);
            (request.motion, request.culling) = (of_sensor.clone(), culling);
            let mut placed = PlacedTarget::new(target);
            placed.world_from_object = DAffine3::from_translation(DVec3::X * x_m);
            placed.motion.clone_from(&of_car);
            scan_objects(&OpenCaster::Cpu(Effects::default()), &[placed], &request).unwrap().scan
        });
        assert_eq!(culled, all);
        all
    };
    let at =
        |at_s: f64, [x, y]: [f64; 2], yaw_rad: f64| (at_s, pose([x, y, 0.0], DVec3::Z, yaw_rad));
    assert!(seen(swerving(), &lump, 0.0, passing()).len() > 30);
    // A car whose frame is far from its origin, as in a map, and turns: it passes by the sensor.
    let turning = moving(&[at(0.0, [-6.0, 0.0], -1.0), at(0.1, [-6.0, 0.0], 1.0)]);
    assert!(seen(None, &lump, 10.0, turning).len() > 30);
    // 3 m ahead, what the beams meet 28 degrees to the right they meet again, a turn later, as far to
    // the left, as the sensor or the car goes by.
    let ball = casting::target(&meshes::mapped(&meshes::icosphere(3), |p| p * 0.5));
    let along_y = |from, to| moving(&[at(0.0, [0.0, from], 0.0), at(0.1, [0.0, to], 0.0)]);
    for (of_sensor, of_car) in [(along_y(2.0, -2.0), None), (None, along_y(-2.0, 2.0))] {
        let times_s = seen(of_sensor, &ball, 3.0, of_car).time_s.unwrap();
        assert!(times_s.iter().any(|s| *s < 0.02) && times_s.iter().any(|s| *s > 0.08));
    }
}

#[test]
fn culling_loses_nothing_of_beams_that_start_beside_the_axis_at_rest_and_in_motion() {
    // Beside the axis, and above and below the sensor as those of packets.
    type Change = fn(&mut Rotating);
    let changes: [Change; 2] =
        [|head| head.beam_start_m = Some(1.0), |head| head.beam_crossing_m = Some(0.0424)];
    // What stands still as a sensor that may move does, too.
    let still = moving(&[0.0, 1.0].map(|at_s| (at_s, pose([0.0; 3], DVec3::Z, 0.0))));
    for change in changes {
        let mut sensor = SensorProfile::builtin("vlp32c").unwrap();
        let Layout::Rotating(head) = &mut sensor.layout else { panic!("a VLP-32C rotates") };
        change(head);
        let pattern = sensor.pattern();
        for (motion, radius_m) in [(None, 0.8), (swerving(), 0.8), (still.clone(), 0.05)] {
            let ball = meshes::mapped(&meshes::icosphere(3), |p| p * radius_m + DVec3::X * 3.5);
            let near = casting::target(&ball);
            let [culled, all] = [Culling::On, Culling::Off].map(|culling| {
                let mut request = request(&sensor, &pattern);
                (request.motion, request.culling) = (motion.clone(), culling);
                let cpu = OpenCaster::Cpu(Effects::default());
                scan_objects(&cpu, &[PlacedTarget::new(&near)], &request).unwrap().scan
            });
            assert!(culled.len() > 5, "{}", culled.len());
            assert_eq!(culled, all);
        }
    }
}

#[test]
fn deskewed_points_of_still_objects_are_where_they_are() {
    let (sensor, targets) = (sensor(), targets());
    let pattern = sensor.pattern();
    let mut request = request(&sensor, &pattern);
    (request.motion, request.deskew) = (swerving(), true);
    let cpu = OpenCaster::Cpu(Effects::default());
    let scan = scan_objects(&cpu, &[PlacedTarget::new(&targets[0])], &request).unwrap().scan;
    let off_m = |p: &[f32; 3]| (DVec3::from(p.map(f64::from)).abs().max_element() - 9.0).abs();
    assert!(scan.positions.iter().all(|p| off_m(p) < 1e-5));
    request.deskew = false;
    let raw = scan_objects(&cpu, &[PlacedTarget::new(&targets[0])], &request).unwrap().scan;
    assert_eq!(raw.range_m, scan.range_m);
    assert!(raw.positions.iter().filter(|p| off_m(p) > 0.1).count() > raw.len() / 4);
    // The attitude turns what a beam saw into the world.
    for i in (0..scan.len()).step_by(53) {
        let rotation = scan.attitude_rad.as_ref().unwrap()[i].map(f64::from);
        let direction = pattern.directions[scan.beam.as_ref().unwrap()[i] as usize];
        let turned = DQuat::from_scaled_axis(rotation.into()) * direction;
        let from = DVec3::from(scan.sensor_m.as_ref().unwrap()[i].map(f64::from));
        let point = DVec3::from(scan.positions[i].map(f64::from));
        assert!((point - from).normalize().distance(turned) < 1e-6);
    }
}

#[test]
fn still_scene_has_the_scan_without_motion() {
    let (sensor, targets) = (sensor(), targets());
    let pattern = sensor.pattern();
    let weather = Some(Box::new(Weather { rain_mm_h: Some(50.0), ..Weather::default() }));
    let caster = OpenCaster::Cpu(Effects { weather, ..Effects::default() });
    let placed = || [PlacedTarget::new(&targets[0]), PlacedTarget::new(&targets[1])];
    let still = request(&sensor, &pattern);
    let mut resting = still.clone();
    resting.motion = moving(&[(0.0, still.pose)]);
    let mut rests = placed();
    rests[1].motion = moving(&[(0.0, pose([0.0; 3], DVec3::Z, 0.0))]);
    let [a, b] = [(placed(), still), (rests, resting)]
        .map(|(placed, request)| scan_objects(&caster, &placed, &request).unwrap());
    assert_eq!((a.scan, a.tally), (b.scan, b.tally));
}
