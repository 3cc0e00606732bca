//! Programs that classify clouds and packets.

use std::path::Path;

use infer_cpu::live::{Arrival, LiveOptions, Object, Pipeline};
use infer_cpu::{Classifier, Options};
use test_support::need;

use crate::compiler::{Compiler, static_link};
use crate::{assert_program_succeeds, model, run, street, text};

/// A cloud whose longest axis is y; the last line has the largest x.
const CLOUD: &str = "0 0 0.01\n0.5 0.25 0.125\n0.1 0.75 0.2\n\n  1e-1\t0.9 .3\n";

#[test]
fn the_example_gives_what_the_rust_library_gives() {
    let compiler = need!(Compiler::c());
    let example = compiler.compile("examples/classify.c", &static_link());
    let model = compiler.folder().join("model.safetensors");
    model::write_longest_axis_model(&model);

    let numbers: Vec<f32> = CLOUD.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let mut classifier = Classifier::load(&model, &Options::default()).unwrap();
    let expected = classifier.classify(numbers.as_chunks().0).unwrap();
    assert_eq!(&*expected.label, "y");
    let expected = format!(
        "y ({:.1} %), {} of {} points used\n",
        100.0 * expected.confidence(),
        expected.n_used,
        expected.n_points,
    );

    let cloud = compiler.folder().join("cloud.xyz");
    std::fs::write(&cloud, CLOUD).unwrap();
    let output = run(&example, &[&model, &cloud]);
    assert_eq!(text(&output.stderr), "");
    assert_eq!(text(&output.stdout), expected);

    let rod = run(&example, &[&model]);
    assert!(text(&rod.stdout).starts_with("z ("), "{}", text(&rod.stdout));
}

/// A second of a VLP-16 in a street, as a capture and as the Rust library answers it.
#[test]
fn the_example_of_packets_gives_what_the_rust_library_gives() {
    let compiler = need!(Compiler::c());
    let example = compiler.compile("examples/live.c", &static_link());
    let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
    let model = weights.join("street-bev.safetensors");
    let sent = street::packets(&street::street(), 7, street::PACKETS_PER_S);
    let time_us = |i: usize| 1_000_000_000 + (i as f64 * street::PACKET_S * 1e6) as u64;
    let capture = compiler.folder().join("drive.pcap");
    let timed = sent.iter().enumerate().map(|(i, packet)| (time_us(i), &packet[..]));
    std::fs::write(&capture, street::capture(timed)).unwrap();

    let live = LiveOptions::default();
    let mut pipeline = Pipeline::open(&model, &Options::default(), &live).unwrap();
    let mut expected = String::new();
    let mut write = |object: &Object| {
        let [x, y, z] = object.position_m;
        let class = object.class.as_deref().unwrap_or("-");
        let length = object.whole_box.map_or("-".into(), |whole| format!("{:.3}", whole.size_m[0]));
        let (track, points) = (object.track, object.points);
        expected += &format!("{track} {class} {x:.3} {y:.3} {z:.3} {points} {length}\n");
    };
    for (i, packet) in sent.iter().enumerate() {
        let (seconds, micros) = (time_us(i) / 1_000_000, time_us(i) % 1_000_000);
        let time_s = seconds as f64 + 1e-6 * micros as f64;
        pipeline.take(packet, Arrival { time_s, moment: None });
        pipeline.answer(&mut write);
    }
    pipeline.end();
    pipeline.answer(&mut write);
    let output = run(&example, &[&model, &capture]);
    assert_eq!(text(&output.stderr), "754 packets, 0 lost, 0 foreign\n");
    assert_eq!(text(&output.stdout), expected);
    assert!(expected.lines().count() > 20);
    let n_whole = expected.lines().filter(|line| !line.ends_with(" -")).count();
    assert!(n_whole > 10, "{expected}");

    std::fs::write(&capture, "no capture").unwrap();
    let output = run(&example, &[&model, &capture]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("expected a capture"), "{}", text(&output.stderr));
}

#[test]
fn the_example_says_what_is_wrong() {
    let compiler = need!(Compiler::c());
    let example = compiler.compile("examples/classify.c", &static_link());
    let model = compiler.folder().join("model.safetensors");
    model::write_longest_axis_model(&model);
    let cloud = compiler.folder().join("cloud.xyz");
    let missing = compiler.folder().join("missing");

    let complaint = |arguments: &[&Path]| {
        let output = run(&example, arguments);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(1), ""));
        text(&output.stderr).to_owned()
    };
    assert!(complaint(&[&missing]).starts_with(missing.to_str().unwrap()));
    assert!(complaint(&[&model, &missing]).starts_with(missing.to_str().unwrap()));
    std::fs::write(&cloud, "0 0 0\n1 one 1\n").unwrap();
    assert!(complaint(&[&model, &cloud]).contains("point 1 is not three numbers"));
    std::fs::write(&cloud, "").unwrap();
    assert_eq!(
        complaint(&[&model, &cloud]),
        "the cloud has no points that are finite and not at 0, 0, 0\n"
    );
    assert_eq!(run(&example, &[]).status.code(), Some(2));
}

#[test]
fn the_promises_of_classifiers_hold_in_c() {
    let compiler = need!(Compiler::c());
    let model = compiler.folder().join("model.safetensors");
    model::write_longest_axis_model(&model);
    assert_program_succeeds(&compiler, "tests/c/classify.c", &[&model]);
}
