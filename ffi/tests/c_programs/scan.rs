//! Programs that scan scenes.

use std::path::Path;

use sim_gpu::effects::Noise;
use sim_gpu::glam::DVec3;
use sim_gpu::{Mesh, Moves, Pose, Scene, Sensor};
use test_support::need;

use crate::compiler::{Compiler, static_link};
use crate::{assert_program_succeeds, run, text, write};

/// A camera of 7 times 5 pixels.
const SENSOR: &str = "name = \"camera\"\ndescription = \"35 pixels\"\nsources = [\"the test\"]\n\
                      [range]\nmax_m = 100.0\n\
                      [grid]\nwidth = 7\nheight = 5\nfov_x_deg = 42.0\nfov_y_deg = 30.0\n";

/// A square in the plane x = 0, two metres wide, as in the example.
const SQUARE: &str = "OFF\n4 2 0\n0 -1 -1\n0 1 -1\n0 1 1\n0 -1 1\n3 0 2 1\n3 0 3 2\n";

/// The world of the example.
fn world() -> Scene {
    let corners = vec![[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]];
    let square = Mesh::from_triangles(corners, vec![[0, 2, 1], [0, 3, 2]]).unwrap();
    let mut scene = Scene::new();
    let wall = scene.add(&square, Pose::at([10.0, 0.0, 0.0]));
    let plate = scene.add(&square, Pose::at([5.0, 1.0, 0.0]));
    scene[wall].scale = [1.0, 9.0, 9.0].into();
    scene[plate].scale = [1.0, 0.5, 0.5].into();
    scene.seed = 7;
    scene
}

/// The object that a beam of this direction from (x, 0, 0) meets in that world, the plate standing at
/// `plate`, and its range.
fn met(direction: DVec3, x: f64, plate: DVec3) -> Option<(u32, f64)> {
    let hit = |at: DVec3, half: f64| {
        let range_m = (at.x - x) / direction.x;
        let off = (direction * range_m - at).abs();
        (off.y <= half && off.z <= half).then_some(range_m)
    };
    let plate = hit(plate, 0.5).map(|range_m| (1, range_m));
    plate.or(hit(DVec3::new(10.0, 0.0, 0.0), 9.0).map(|range_m| (0, range_m)))
}

#[test]
fn the_example_gives_what_the_rust_library_and_closed_forms_give() {
    let compiler = need!(Compiler::c());
    let example = compiler.compile("examples/world.c", &static_link());
    let file = write(&compiler, "camera.toml", SENSOR);
    let sensor = Sensor::read(&file).unwrap();
    let directions = sensor.directions();
    for sigma_m in [0.0, 0.01] {
        let check = |beam: usize, x: f64, plate: DVec3, found: (u32, f32)| {
            let (object, range_m) = met(directions[beam], x, plate).unwrap();
            assert_eq!(found.0, object);
            // Rounded to f32 once; 3e-12 of all noise is beyond 7 standard deviations.
            let bound = range_m * f64::from(f32::EPSILON) + 7.0 * sigma_m;
            assert!((f64::from(found.1) - range_m).abs() <= bound, "{found:?} {range_m}");
        };
        let mut scene = world();
        scene.effects.noise = Some(Noise::along_range(sigma_m));
        let scan = scene.scan(&sensor, Pose::IDENTITY).run().unwrap().points;
        let mut expected = Vec::new();
        let columns = scan.beam.unwrap().into_iter().zip(scan.object.unwrap());
        for ((beam, object), range_m) in columns.zip(scan.range_m.unwrap()) {
            check(beam as usize, 0.0, DVec3::new(5.0, 1.0, 0.0), (object, range_m));
            expected.push([beam as f32, range_m, object as f32, [1.0, 7.0][object as usize]]);
        }
        let poses = [0.0, 0.25, 0.5].map(|x| Pose::at([x, 0.0, 0.0]));
        let plates = [2.0, 3.0, 4.0].map(|x| Pose::at([x, 0.0, 0.0]));
        let instances: Vec<_> = scene.ids().skip(1).collect();
        let moves = Moves { instances: &instances, poses: &plates };
        let batch = scene.cast(&sensor, &poses, moves).unwrap();
        for (i, (range_m, object)) in batch.range_m.into_iter().zip(batch.object).enumerate() {
            let (pose, beam) = (i / directions.len(), i % directions.len());
            let [x, plate] = [poses[pose], plates[pose]].map(|pose| pose.position_m);
            check(beam, x.x, plate, (object, range_m));
            expected.push([pose as f32, beam as f32, range_m, object as f32]);
        }
        let toml = format!("noise = {{ sigma_m = {sigma_m} }}");
        let output = run(&example, &[&file, Path::new(&toml)]);
        assert_eq!(text(&output.stderr), "");
        // Nine digits tell each float from all others.
        let words = text(&output.stdout).split_whitespace();
        let found: Vec<f32> = words.map(|word| word.parse().unwrap()).collect();
        assert_eq!(found, expected.as_flattened());
    }
    let output = run(&example, &[&file, Path::new("noise = 1")]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).starts_with("effects: line 1: noise"), "{output:?}");
}

#[test]
fn the_promises_of_scans_hold_in_c() {
    let compiler = need!(Compiler::c());
    let sensor = write(&compiler, "camera.toml", SENSOR);
    let square = write(&compiler, "square.off", SQUARE);
    assert_program_succeeds(&compiler, "tests/c/scan.c", &[&sensor, &square]);
}

#[cfg(target_os = "linux")]
#[test]
fn memory_stays_flat_over_100_000_steps_and_nothing_starts_threads_but_casts() {
    let compiler = need!(Compiler::c());
    let tiny = SENSOR.replace("width = 7", "width = 2").replace("height = 5", "height = 2");
    let sensor = write(&compiler, "tiny.toml", &tiny);
    let steps = compiler.compile("tests/c/steps.c", &static_link());
    let output = run(&steps, &[&sensor]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(text(&output.stdout), "1 thread before the first cast\n");
}
