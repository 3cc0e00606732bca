//! `gen-scenes` and `detect`.

use crate::{Folder, in_repository};
use edgepuck_segment::{Label, Sweep};
use formats::cloud_file::write_cloud;
use formats::labelled::read_labelled;
use infer_cpu::Options;
use infer_cpu::detect::Detector;
use serde_json::Value;
use test_support::{need, shared_data};

#[test]
fn scenes_are_scanned_cut_labelled_and_packed() {
    let folder = Folder::new();
    let said = folder.succeeds("gen-scenes yard --adapter cpu --sweeps 10 --save 2 --out one");
    assert!(said.contains("10 sweeps"), "{said}");
    assert!(folder.at("one/packed/test.npz").exists());
    let set = read_labelled(&folder.at("one/packed/train.npz")).unwrap();
    let classes = set.classes.clone().unwrap();
    assert!(classes.is_sorted() && classes.contains(&"other".to_owned()), "{classes:?}");
    assert!(set.len() > 50, "{} clusters", set.len());
    // In the sensor frame, no cluster is beyond the range of the recipe's sensors.
    let farthest = set.range_m.as_ref().unwrap().iter().fold(0.0, |far: f32, r| far.max(*r));
    assert!((5.0..200.0).contains(&farthest), "{farthest} m");

    let scene: Value = serde_json::from_slice(&folder.bytes("one/sweeps/000001.json")).unwrap();
    let points: u64 =
        scene["objects"].as_array().unwrap().iter().map(|o| o["points"].as_u64().unwrap()).sum();
    let scan = folder.scan("one/sweeps/000001.npz");
    let on_objects = scan.object.unwrap().iter().filter(|&&object| object > 0).count() as u64;
    assert_eq!(points, on_objects);

    // Every tenth sweep is in the test part. Training ends with a test, and says so at once.
    let yard = in_repository("assets/scenes/yard.toml");
    let yard = std::fs::read_to_string(yard).unwrap();
    let none = "\n[[object]]\nkind = \"car\"\nclass = \"car\"\ncount = [0, 0]\nplace = \"anywhere\"\n\
                distance_m = [5, 9]\n";
    folder.write("yard.toml", yard + none);
    let said = folder.succeeds("gen-scenes yard.toml --adapter cpu --sweeps 9 --save 0 --out few");
    assert!(said.contains("a car: no scene has it: its count is [0, 0]"), "{said}");
    folder.write("metric.toml", "points = 16\nnormalization = \"metric\"\n");
    let said = folder.exits(1, "train --data few/packed --recipe metric.toml --out m.safetensors");
    assert!(said.contains("its test part is empty") && !said.contains("epoch 1"), "{said}");
    assert!(!folder.at("m.run").exists());
}

#[test]
fn a_sweep_is_cut_and_its_clusters_are_named() {
    let folder = Folder::new();
    let said = folder.succeeds("gen-scenes --adapter cpu --sweeps 1 --save 1 --out scenes");
    assert!(said.contains("warning: no cluster is in the test part"), "{said}");
    // One scene lacks some objects by chance.
    assert!(!said.contains("no scene has it"), "{said}");
    // Files of others stay, whatever is replaced.
    std::fs::write(folder.at("scenes/sweeps/mine.bin"), "mine").unwrap();
    for flag in ["", "--overwrite"] {
        let words = format!("gen-scenes --adapter cpu --sweeps 1 --out scenes {flag}");
        folder.refuses(2, &[(&words, "mine.bin: expected only files that this command wrote")]);
    }
    assert!(folder.at("scenes/packed/train.npz").exists());
    let sweep = "scenes/sweeps/000000.npz";
    let said = folder.succeeds(&format!("detect {sweep} --segment-only --out clusters"));
    assert!(said.contains("clusters, "), "{said}");
    assert!(folder.bytes("clusters/sweep.ply").starts_with(b"ply\n"));
    assert!(folder.bytes("clusters/cluster-0000.npy").starts_with(b"\x93NUMPY"));
    assert!(folder.bytes("clusters/preview.png").starts_with(b"\x89PNG"));

    let said = folder.succeeds(&format!("detect {sweep} --out objects.json"));
    assert!(said.contains(" other clusters: objects.json"), "{said}");
    let found: Value = serde_json::from_slice(&folder.bytes("objects.json")).unwrap();
    let objects = found["objects"].as_array().unwrap();
    assert!(!objects.is_empty());
    let known = ["car", "person", "truck", "bus", "two-wheeler"];
    for object in objects {
        assert!(known.contains(&object["class"].as_str().unwrap()), "{object}");
        assert!(object["points"].as_u64().unwrap() >= 20);
        assert!((0.0..=1.0).contains(&object["confidence"].as_f64().unwrap()));
        let size: Vec<f64> = serde_json::from_value(object["box"]["size_m"].clone()).unwrap();
        let centre: Vec<f64> = serde_json::from_value(object["box"]["centre_m"].clone()).unwrap();
        let range_m = object["range_m"].as_f64().unwrap();
        assert!((range_m - centre[0].hypot(centre[1])).abs() < 1e-4, "{object}");
        assert!(size[0] >= size[1] && size[0] < 30.0, "{object}");
        let whole: Vec<f64> =
            serde_json::from_value(object["whole_box"]["size_m"].clone()).unwrap();
        // Sizes of its class, with a margin of a quarter.
        let [least, most] = match object["class"].as_str().unwrap() {
            "car" => [[2.5, 1.3], [6.5, 2.5]],
            "person" => [[0.2, 0.2], [1.3, 1.2]],
            "truck" | "bus" => [[3.5, 1.5], [19.0, 3.6]],
            _ => [[1.0, 0.3], [2.8, 1.3]],
        };
        assert!((0..2).all(|i| (least[i]..=most[i]).contains(&whole[i])), "{object}");
    }
    // Whole boxes stand on the ground, which is below the lowest points of most objects.
    let bottom_m = |object: &Value, key: &str| {
        let of = |part: &str| object[key][part][2].as_f64().unwrap();
        of("centre_m") - 0.5 * of("size_m")
    };
    let is_lower = |one: &&Value| bottom_m(one, "whole_box") < bottom_m(one, "box") - 0.1;
    assert!(objects.iter().filter(is_lower).count() > 0, "{objects:?}");
    assert!(!objects.iter().any(|one| bottom_m(one, "whole_box") > bottom_m(one, "box") + 0.1));
    assert!(!folder.at("objects.png").exists(), "nothing is written that was not named");
    // Each object has the points of the cluster that it names, whatever unknown ones stand before it.
    let (scan, model) =
        (folder.scan(sweep), in_repository("assets/weights/street-bev.safetensors"));
    let mut detector = Detector::open(&model, &Options::default(), 20).unwrap();
    let sweep_of = Sweep { points: &scan.positions, rings: scan.ring.as_deref() };
    let found = detector.detect(&sweep_of).unwrap();
    assert!(found.n_other > 0 && !found.objects.is_empty());
    for object in &found.objects {
        let own = |label: &&Label| **label == Label::Cluster(object.cluster);
        assert_eq!(found.labels.iter().filter(own).count(), object.n_points);
    }

    let confident = objects.iter().filter(|one| one["confidence"].as_f64().unwrap() >= 0.9);
    let said = folder.succeeds(&format!("detect {sweep} --min-confidence 0.9 --out labels.txt"));
    assert!(said.contains("the labels are in the sensor's frame"), "{said}");
    let labels = folder.text("labels.txt");
    assert!(labels.lines().count() < objects.len(), "{labels}");
    for (line, object) in labels.lines().zip(confident.clone()) {
        let words: Vec<&str> = line.split(' ').collect();
        assert_eq!(words.len(), 16, "{line}");
        let centre: Vec<f64> =
            serde_json::from_value(object["whole_box"]["centre_m"].clone()).unwrap();
        let x: f64 = words[11].parse().unwrap();
        assert!((x - centre[0]).abs() <= 0.005 + 1e-9, "{line}: {object}");
    }
    assert_eq!(labels.lines().count(), confident.count());

    let whole = format!("detect {sweep} --model edge-64 --out whole.json");
    folder.refuses(1, &[(&whole, "edge-64: card: expected a bird's-eye model")]);
}

/// SemanticKITTI's class (semantic-kitti.yaml) of a kind.
fn semantic_class(kind: &str) -> u32 {
    match kind {
        "air" => 1,
        "ground" => 49,
        "car" => 10,
        "bicycle" => 11,
        "truck" => 18,
        "person" => 30,
        "house-front" => 50,
        "wall" | "fence" | "barrier" => 51,
        "bush" | "hedge" | "tree" => 70,
        "trunk" => 71,
        "pole" => 80,
        "traffic-cone" | "bin" | "clutter" => 99,
        _ => panic!("{kind}"),
    }
}

/// A yard in the rain, beside the scan and the description of `--save`.
#[test]
fn labels_have_the_class_and_the_object_of_each_point() {
    let folder = Folder::new();
    let yard = std::fs::read_to_string(in_repository("assets/scenes/yard.toml")).unwrap();
    let rain = "effects = { weather = { rain_mm_h = 50 }, noise";
    folder.write("rain.toml", yard.replace("effects = { noise", rain));
    let scenes = "gen-scenes rain.toml --adapter cpu --seed 3 --sweeps 1 --save 1 --out yard";
    folder.succeeds(&format!("{scenes} --layout semantickitti"));
    let scan = folder.scan("yard/sweeps/000000.npz");
    let described: Value =
        serde_json::from_slice(&folder.bytes("yard/sweeps/000000.json")).unwrap();
    let sweep = "yard/semantickitti/sequences/00/velodyne/000000.bin";
    let [bin, label] =
        [sweep.to_owned(), sweep.replace("velodyne", "labels").replace("bin", "label")]
            .map(|file| folder.bytes(&file));
    let n = scan.len();
    assert_eq!([bin.len(), label.len()], [16 * n, 4 * n]);
    let objects = described["objects"].as_array().unwrap();
    let mut kinds = std::collections::BTreeSet::new();
    for i in 0..n {
        let intensity = scan.intensity.as_ref().unwrap()[i];
        assert_eq!(bin[16 * i + 12..][..4], intensity.to_le_bytes());
        let object = scan.object.as_ref().unwrap()[i];
        let kind = objects.get((object as usize).wrapping_sub(1));
        let (object, kind) = match (object, kind) {
            (0, _) => (0, "ground"),
            (_, None) => (0, "air"),
            (_, Some(of)) => (object, of["kind"].as_str().unwrap()),
        };
        kinds.insert(kind);
        let expected = object << 16 | semantic_class(kind);
        assert_eq!(label[4 * i..][..4], expected.to_le_bytes(), "{kind}");
    }
    assert!(kinds.is_superset(&["air", "ground", "car"].into()), "{kinds:?}");
    let said = folder.succeeds(&format!("view {sweep} --out scan.png"));
    assert!(said.contains(&format!("{n} points")), "{said}");
}

#[test]
fn every_command_reads_points_of_every_format() {
    let folder = Folder::new();
    // A box on the ground, 5 m from the sensor; all numbers fit f32.
    let grid =
        |n: i32| (-n..=n).flat_map(move |i| (-n..=n).map(move |k| [f64::from(i), f64::from(k)]));
    let mut points: Vec<_> = grid(40).map(|[x, y]| [x * 0.25, y * 0.25, -1.5]).collect();
    points.extend(grid(5).map(|[y, z]| [5.0, y * 0.125, z * 0.125 - 0.25]));
    let names = ["a.npz", "a.ply", "a.npy", "a.pcd", "a.xyz", "a.pts", "a.csv", "a.bin"];
    let four =
        points.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0].map(|x| (x as f32).to_le_bytes()));
    folder.write("a.bin", four.flatten().collect::<Vec<u8>>());
    for name in names {
        if name != "a.bin" {
            write_cloud(&folder.at(name), &points).unwrap();
        }
        let said = folder.succeeds(&format!("view {name} --overwrite --out scan.png"));
        assert!(said.contains(&format!("{} points: scan.png", points.len())), "{said}");
        folder.succeeds(&format!("detect {name} --overwrite --out objects.json"));
    }
    // Each command by another format.
    let said = folder.succeeds("detect a.pcd --segment-only --out clusters --radius 0.3");
    assert!(said.contains(" 2 clusters"), "{said}");
    folder.succeeds("corrupt a.csv --fog 100 --reflectivity 0.5 --out fog.npz");
    folder.succeeds("corrupt a.bin --only crosstalk --severity 1 --out corrupted");
    let five: Vec<u8> = (0..)
        .zip(&points)
        .flat_map(|(i, &[x, y, z])| [x, y, z, 0.0, f64::from(i % 32)])
        .flat_map(|number| (number as f32).to_le_bytes())
        .collect();
    folder.write("five.bin", &five);
    folder.write("five", &five);
    folder.refuses(
        1,
        &[
            (
                "detect five.bin --segment-only --out out",
                "look like rings of nuScenes: name the format by --input-format",
            ),
            ("detect five.bin --out out.json", "five.bin: format: the fifth numbers"),
            ("view five --out out.png", "five: extension: unknown cloud format ``"),
            ("view - --out out.png", "-: name: expected a file, found standard input, which"),
            #[cfg(unix)]
            ("detect /dev/null --out out.json", "expected a file, found a pipe or device, which"),
        ],
    );
    for file in ["five.bin", "five"] {
        folder.succeeds(&format!(
            "detect {file} --segment-only --overwrite --input-format nuscenes --out clusters --radius 0.3"
        ));
    }

    // UTM: in f32 the box would be in steps of half a metre.
    let [east, north] = [691_000.0, 5_334_000.0];
    let far: Vec<_> = points.iter().map(|[x, y, z]| [x + east, y + north, *z]).collect();
    write_cloud(&folder.at("utm.npy"), &far).unwrap();
    let segment = "detect utm.npy --segment-only --overwrite --out clusters --radius 0.3";
    folder.refuses(1, &[(segment, "give the sensor's position by --origin")]);
    let said = folder.succeeds(&format!("{segment} --origin {east} {north} 0"));
    assert!(said.contains(" 2 clusters"), "{said}");
    assert!(!said.contains("numbers of 32 bits"), "{said}");
    let rounded: Vec<_> = far.iter().map(|point| point.map(|x| f64::from(x as f32))).collect();
    write_cloud(&folder.at("rounded.npy"), &rounded).unwrap();
    let segment = "detect rounded.npy --segment-only --overwrite --out clusters --radius 0.3";
    let said = folder.succeeds(&format!("{segment} --origin {east} {north} 0"));
    assert!(said.contains("32 bits, which are 0.5 m apart at 533401"), "{said}");
    folder.succeeds("view utm.npy --out out.png");
}

#[test]
fn captures_of_several_senders_and_interfaces_are_read() {
    let inputs = need!(shared_data("bug_inputs"));
    let folder = Folder::new();
    let file = |name: &str| inputs.join(name).display().to_string();
    let said = folder
        .succeeds(&format!("detect {} --segment-only --out clusters", file("two_senders.pcap")));
    assert!(
        said.contains("warning: ") && said.contains("--from ") && said.contains(" chooses another"),
        "{said}"
    );
    let chosen = |address| {
        folder.succeeds(&format!(
            "view {} --overwrite --out scan.png --from {address}",
            file("two_senders.pcap")
        ))
    };
    assert_ne!(chosen("192.168.1.201"), chosen("192.168.1.202"));
    folder.succeeds(&format!("detect {} --out a.json", file("linux_cooked.pcap")));
}
