//! `gen-scenes`, `segment` and `detect`.

use crate::{Folder, in_repository};
use formats::cloud_file::write_cloud;
use formats::labelled::read_labelled;
use serde_json::Value;
use test_support::{need, shared_data};

#[test]
fn scenes_are_scanned_cut_labelled_and_packed_alike_every_time() {
    let folder = Folder::new();
    for out in ["one", "other"] {
        let said = folder
            .succeeds(&format!("gen-scenes yard --adapter cpu --sweeps 10 --save 2 --out {out}"));
        assert!(said.contains("10 sweeps"), "{said}");
    }
    for file in ["packed/train.npz", "packed/test.npz", "sweeps/000001.npz", "preview.png"] {
        let [one, other] = ["one", "other"].map(|out| folder.bytes(&format!("{out}/{file}")));
        assert!(one == other, "{file} differs");
    }
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
    let said = folder.succeeds(&format!("segment {sweep} --out clusters"));
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
        assert!(size[0] >= size[1] && size[0] < 30.0, "{object}");
        let whole: Vec<f64> =
            serde_json::from_value(object["whole_box"]["size_m"].clone()).unwrap();
        let usual = match object["class"].as_str().unwrap() {
            "car" => [3.9, 1.6],
            "person" => [0.8, 0.6],
            "truck" => [6.93, 2.51],
            "bus" => [10.5, 2.94],
            _ => [1.76, 0.6],
        };
        assert!((0..2).all(|i| whole[i] >= usual[i] - 1e-6), "{object}");
        assert!(whole[0] >= size[1] && whole[0] * whole[1] >= size[0] * size[1], "{object}");
    }
    assert!(folder.bytes("objects.png").starts_with(b"\x89PNG"));

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

    let said = folder.succeeds(&format!("detect {sweep} --model edge-64 --out whole.json"));
    assert!(said.contains("warning: edge-64: expected a model of clusters in metres"), "{said}");
}

/// SemanticKITTI's label (semantic-kitti.yaml) and the ASPRS's code (LAS 1.4, table 17) of a kind.
fn codes(kind: &str) -> (u16, u8) {
    match kind {
        "air" => (1, 7),
        "ground" => (49, 2),
        "car" => (10, 1),
        "bicycle" => (11, 1),
        "truck" => (18, 1),
        "person" => (30, 1),
        "house-front" => (50, 6),
        "wall" | "fence" | "barrier" => (51, 1),
        "bush" | "hedge" => (70, 4),
        "tree" => (70, 5),
        "trunk" => (71, 5),
        "pole" => (80, 1),
        "traffic-cone" | "bin" | "clutter" => (99, 1),
        _ => panic!("{kind}"),
    }
}

/// A yard in the rain. Points are compared whole, by the layouts of KITTI (four f32), of PCD's
/// fields, and of LAS 1.2 (point format 0; scales and offsets from byte 131).
#[test]
fn sweeps_name_the_class_and_the_object_of_each_point() {
    let folder = Folder::new();
    let yard = std::fs::read_to_string(in_repository("assets/scenes/yard.toml")).unwrap();
    let rain = "[[sensor]]\neffects = { weather = { rain_mm_h = 50 } }";
    folder.write("rain.toml", yard.replace("[[sensor]]", rain));
    let scenes = "gen-scenes rain.toml --adapter cpu --seed 3 --sweeps 1 --save 1 --out";
    for format in ["npz", "semantickitti", "pcd", "las"] {
        folder.succeeds(&format!("{scenes} {format} --format {format}"));
    }
    let scan = folder.scan("npz/sweeps/000000.npz");
    let said: Value = serde_json::from_slice(&folder.bytes("las/sweeps/000000.json")).unwrap();
    let classes: Vec<String> = serde_json::from_value(said["classes"].clone()).unwrap();
    assert_eq!(classes[..2], ["air", "ground"]);
    let [bin, label, pcd, las] = [
        "semantickitti/sweeps/velodyne/000000.bin",
        "semantickitti/sweeps/labels/000000.label",
        "pcd/sweeps/000000.pcd",
        "las/sweeps/000000.las",
    ]
    .map(|file| folder.bytes(file));
    let n = scan.len();
    assert_eq!([bin.len(), label.len()], [16 * n, 4 * n]);
    let header = String::from_utf8_lossy(&pcd[..pcd.len() - 26 * n]);
    assert!(header.contains("\nFIELDS x y z intensity ring label instance\nSIZE 4 4 4 4 2 4 4\n"));
    assert!(header.contains("\nTYPE F F F F U U U\nCOUNT 1 1 1 1 1 1 1\n"), "{header}");
    assert!(header.ends_with(&format!("POINTS {n}\nDATA binary\n")), "{header}");
    let at_f64 = |at: usize| f64::from_le_bytes(las[at..at + 8].try_into().unwrap());
    let las_at = u32::from_le_bytes(las[96..100].try_into().unwrap()) as usize;
    assert_eq!(las.len() - las_at, 20 * n);
    let objects = said["objects"].as_array().unwrap();
    let (mut kinds, rings) = (std::collections::BTreeSet::new(), scan.ring.as_ref().unwrap());
    for i in 0..n {
        let intensity = scan.intensity.as_ref().unwrap()[i];
        let [x, y, z] = scan.positions[i];
        let row: Vec<u8> = [x, y, z, intensity].iter().flat_map(|x| x.to_le_bytes()).collect();
        assert_eq!([&bin[16 * i..][..16], &pcd[pcd.len() - 26 * (n - i)..][..16]], [&row; 2]);

        let object = scan.object.as_ref().unwrap()[i] as usize;
        let named = |key| objects.get(object - 1).map_or("air", |of| of[key].as_str().unwrap());
        let [kind, class] = if object == 0 { ["ground"; 2] } else { ["kind", "class"].map(named) };
        let object = if kind == "air" { 0 } else { object as u32 };
        kinds.insert(kind);
        let class = classes.iter().position(|known| known == class).unwrap() as u32;
        let (code, las_code) = codes(kind);
        assert_eq!(label[4 * i..][..4], (object << 16 | u32::from(code)).to_le_bytes(), "{kind}");
        let row = [&rings[i].to_le_bytes()[..], &class.to_le_bytes(), &object.to_le_bytes()];
        assert_eq!(pcd[pcd.len() - 26 * (n - i) + 16..][..10], row.concat(), "{kind}");
        let point = &las[las_at + 20 * i..][..20];
        for (axis, &expected) in scan.positions[i].iter().enumerate() {
            let [scale, offset] = [131, 155].map(|at| at_f64(at + 8 * axis));
            let found = i32::from_le_bytes(point[4 * axis..][..4].try_into().unwrap());
            let wrong = f64::from(found) * scale + offset - f64::from(expected);
            assert!(wrong.abs() <= 0.5 * scale + 1e-9, "{wrong} m of {scale} m");
        }
        let brightness = (65535.0 * intensity).round() as u16;
        assert_eq!(point[12..14], brightness.to_le_bytes());
        assert_eq!([point[15], point[17]], [las_code, class as u8], "{kind}");
        assert_eq!(point[18..20], (object as u16).to_le_bytes());
    }
    assert!(kinds.is_superset(&["air", "ground", "car"].into()), "{kinds:?}");
    for name in ["semantickitti/sweeps/velodyne/000000.bin", "pcd/sweeps/000000.pcd"] {
        let said = folder.succeeds(&format!("preview {name} --overwrite"));
        assert!(said.contains(&format!("{n} points")), "{said}");
    }
}

#[test]
fn every_command_reads_points_of_every_format() {
    let folder = Folder::new();
    // A box on the ground, 5 m from the sensor; all numbers fit f32.
    let grid =
        |n: i32| (-n..=n).flat_map(move |i| (-n..=n).map(move |k| [f64::from(i), f64::from(k)]));
    let mut points: Vec<_> = grid(40).map(|[x, y]| [x * 0.25, y * 0.25, -1.5]).collect();
    points.extend(grid(5).map(|[y, z]| [5.0, y * 0.125, z * 0.125 - 0.25]));
    let names = ["a.npz", "a.ply", "a.npy", "a.pcd", "a.xyz", "a.pts", "a.csv", "a.las", "a.bin"];
    for name in names {
        write_cloud(&folder.at(name), &points).unwrap();
        let said =
            folder.succeeds(&format!("segment {name} --overwrite --out clusters --radius 0.3"));
        assert!(said.contains(" 2 clusters"), "{name}: {said}");
        folder.succeeds(&format!("detect {name} --overwrite --out objects.json"));
        let weather = "--fog 100 --reflectivity 0.5 --overwrite --out fog.npz";
        folder.succeeds(&format!("weather {name} {weather}"));
        folder.succeeds(&format!(
            "corrupt {name} --only crosstalk --severity 1 --overwrite --out corrupted"
        ));
        let said = folder.succeeds(&format!("preview {name} --overwrite"));
        assert!(said.contains(&format!("{} points: scan.png", points.len())), "{said}");
    }
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
                "segment five.bin --out out",
                "look like rings of nuScenes: name the format by --format",
            ),
            ("detect five.bin --out out.json", "five.bin: format: the fifth numbers"),
            ("preview five --out out.png", "five: extension: unknown cloud format ``"),
            ("preview - --out out.png", "-: name: expected a file, found standard input, which"),
            #[cfg(unix)]
            ("detect /dev/null --out out.json", "expected a file, found a pipe or device, which"),
        ],
    );
    for file in ["five.bin", "five"] {
        folder.succeeds(&format!(
            "segment {file} --overwrite --format nuscenes --out clusters --radius 0.3"
        ));
    }

    // UTM: in f32 the box would be in steps of half a metre.
    let [east, north] = [691_000.0, 5_334_000.0];
    let far: Vec<_> = points.iter().map(|[x, y, z]| [x + east, y + north, *z]).collect();
    write_cloud(&folder.at("utm.las"), &far).unwrap();
    let segment = "segment utm.las --overwrite --out clusters --radius 0.3";
    folder.refuses(1, &[(segment, "give the sensor's position by --sensor")]);
    let said = folder.succeeds(&format!("{segment} --sensor {east} {north} 0"));
    assert!(said.contains(" 2 clusters"), "{said}");
    assert!(!said.contains("numbers of 32 bits"), "{said}");
    let rounded: Vec<_> = far.iter().map(|point| point.map(|x| f64::from(x as f32))).collect();
    write_cloud(&folder.at("rounded.npy"), &rounded).unwrap();
    let segment = "segment rounded.npy --overwrite --out clusters --radius 0.3";
    let said = folder.succeeds(&format!("{segment} --sensor {east} {north} 0"));
    assert!(said.contains("32 bits, which are 0.5 m apart at 533401"), "{said}");
    folder.succeeds("preview utm.las --out out.png");
    folder.write("objects.json", "mine");
    folder.refuses(
        2,
        &[
            (
                "segment a.ply --out clusters",
                "clusters: it exists already: --overwrite replaces it",
            ),
            ("detect a.ply --out objects.json", "objects.json: it exists already"),
            ("weather a.ply --rain 1 --reflectivity 1 --out fog.npz", "fog.npz: it exists already"),
            ("corrupt a.ply --reflectivity 1 --out corrupted", "corrupted: it exists already"),
            ("preview a.ply", "scan.png: it exists already"),
        ],
    );
    assert_eq!(folder.text("objects.json"), "mine");
}

#[test]
fn captures_of_several_senders_and_interfaces_are_read() {
    let inputs = need!(shared_data("bug_inputs"));
    let folder = Folder::new();
    let file = |name: &str| inputs.join(name).display().to_string();
    let said = folder.succeeds(&format!("segment {} --out clusters", file("two_senders.pcap")));
    assert!(
        said.contains("warning: ") && said.contains("--from ") && said.contains(" chooses another"),
        "{said}"
    );
    let chosen = |address| {
        folder
            .succeeds(&format!("preview {} --overwrite --from {address}", file("two_senders.pcap")))
    };
    assert_ne!(chosen("192.168.1.201"), chosen("192.168.1.202"));
    folder.succeeds(&format!("detect {} --out a.json", file("linux_cooked.pcap")));
}

#[test]
fn what_cannot_be_used_is_named_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("recipe.toml", "mount = { height_m = [1, 2] }\n[[sensor]]\nprofile = \"vlp99\"\n");
    folder.write(
        "own.toml",
        "mount = { height_m = [1, 2] }\n[[sensor]]\nprofile = \"vlp16\"\n[[object]]\nkind = \"mesh\"\n\
         class = \"chair\"\ncount = [1, 1]\nplace = \"anywhere\"\ndistance_m = [2, 3]\n\
         meshes = \"chairs\"\nheight_m = [1, 1]\n",
    );
    let flat = "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n";
    folder.write("flat/chairs/flat.obj", flat);
    folder.write("not_a_cloud.npz", "nothing");
    folder.write("no_capture.PCAP", "nothing");
    folder.refuses(
        1,
        &[
            ("gen-scenes missing.toml --out out", "missing.toml"),
            ("gen-scenes recipe.toml --out out", "object: expected at least one [[object]]"),
            ("gen-scenes street --sensor vlp99 --out out", "vlp99"),
            (
                "gen-scenes own.toml --out out",
                "chairs: expected a folder with OBJ, OFF, PLY, STL or glTF files",
            ),
            ("gen-scenes own.toml --meshes . --out out", "chairs: expected a folder with OBJ"),
            (
                "gen-scenes own.toml --meshes flat --out out",
                "flat.obj: expected a mesh with a height, found all of it at one height",
            ),
            ("segment missing.npz --out out", "missing.npz"),
            ("segment not_a_cloud.npz --out out", "not_a_cloud.npz"),
            ("segment no_capture.PCAP --out out", "no_capture.PCAP: header: expected a capture"),
            ("segment no_capture.PCAP --metadata missing.json --out out", "missing.json"),
            (
                "segment no_capture.PCAP --metadata recipe.toml --out out",
                "recipe.toml: metadata: expected JSON: expected value at",
            ),
            ("detect missing.npz --model nothing.safetensors --out out.json", "missing.npz"),
            (
                "detect missing.npz --out out.txt --calib flat/chairs/flat.obj",
                "flat.obj: R0_rect: expected this line of the calibration of KITTI's object",
            ),
        ],
    );
    folder.refuses(
        2,
        &[
            (
                "detect missing.npz --out out.png",
                "--out: expected a name with .json or .txt, found out.png",
            ),
            (
                "detect missing.npz --out out.json --calib calib.txt",
                "--calib applies to KITTI's labels",
            ),
            (
                "detect missing.npz --out out.json --min-confidence 2",
                "expected a number from 0 to 1",
            ),
            (
                "preview missing.npz --out out.html",
                "--out: expected a name with .png, found out.html",
            ),
        ],
    );
    folder.write(
        "empty.ply",
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n\
         property float y\nproperty float z\nend_header\n",
    );
    folder.refuses(3, &[("preview empty.ply --out out.png", "empty.ply: expected points, meshes")]);
    assert!(!folder.at("out").exists(), "something was written");
}
