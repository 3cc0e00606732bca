//! `gen-scenes --layout` and `--shard`: data sets for trainers of detectors.

use std::f64::consts::FRAC_PI_2;

use serde_json::Value;

use crate::Folder;

/// Ten scenes of cars, one behind a wall of bins, with a small sensor.
const CARS: &str = "mount = { height_m = [1.5, 1.7], tilt_deg = [0, 2] }\n\
    [[sensor]]\nprofile = \"vlp16\"\n\
    [[object]]\nkind = \"car\"\nclass = \"car\"\ncount = [4, 4]\nplace = \"anywhere\"\n\
    distance_m = [6, 20]\n\
    [[object]]\nkind = \"person\"\nclass = \"person\"\ncount = [6, 6]\nplace = \"anywhere\"\n\
    distance_m = [4, 20]\n";

/// Boxes hold the points of their objects: at least 99 % of them, to within 5 cm, as meshes' extents
/// do but for noise.
#[test]
fn boxes_of_data_sets_for_detectors_hold_their_points() {
    let folder = Folder::new();
    folder.write("cars.toml", CARS);
    let words = "gen-scenes cars.toml --adapter cpu --sweeps 10 --save 10";
    for layout in ["semantickitti", "openpcdet", "kitti"] {
        folder.succeeds(&format!("{words} --layout {layout} --out {layout}"));
    }
    let lists = ["train", "val"]
        .map(|part| folder.text(&format!("openpcdet/openpcdet/ImageSets/{part}.txt")));
    assert_eq!((lists[0].lines().count(), &*lists[1]), (9, "000009\n"));
    let (mut n_boxes, mut n_points, mut n_inside, mut n_hidden) = (0, 0, 0, 0);
    for name in lists.concat().lines() {
        let cloud = folder.bytes(&format!("openpcdet/openpcdet/points/{name}.npy"));
        let points: Vec<[f32; 4]> = rows(&cloud[128..]);
        let (sequence, place) = if name == "000009" { ("08", "000000") } else { ("00", name) };
        let labels = format!("semantickitti/sequences/{sequence}/labels/{place}.label");
        let labels = folder.bytes(&format!("semantickitti/{labels}"));
        let labels = labels.as_chunks::<4>().0.iter().map(|l| u16::from_le_bytes([l[2], l[3]]));
        let labels: Vec<u16> = labels.collect();
        assert_eq!(points.len(), labels.len());
        let about: Value =
            serde_json::from_slice(&folder.bytes(&format!("openpcdet/sweeps/{name}.json")))
                .unwrap();
        let seen = about["objects"].as_array().unwrap().iter().filter(|o| o["points"] != 0);
        let boxes = folder.text(&format!("openpcdet/openpcdet/labels/{name}.txt"));
        let kitti = folder.text(&format!("kitti/kitti/training/label_2/{name}.txt"));
        let mut ahead = kitti.lines().map(|line| line.split(' ').collect::<Vec<_>>()).peekable();
        assert_eq!(boxes.lines().count(), seen.clone().count());
        for (line, object) in boxes.lines().zip(seen) {
            let words: Vec<&str> = line.split(' ').collect();
            assert_eq!(words[7], object["class"]);
            let number = |i: usize| words[i].parse::<f64>().unwrap();
            let own = points.iter().zip(&labels);
            let own = own.filter(|(_, of)| u64::from(**of) == object["object"].as_u64().unwrap());
            for ([x, y, z, _], _) in own {
                let [x, y, z] = [(x, 0), (y, 1), (z, 2)].map(|(at, i)| f64::from(*at) - number(i));
                let (sin, cos) = number(6).sin_cos();
                let off = [x * cos + y * sin, y * cos - x * sin, z];
                n_points += 1;
                n_inside += usize::from((0..3).all(|i| off[i].abs() <= number(3 + i) / 2.0 + 0.05));
            }
            n_boxes += 1;
            // The camera's x is to the right, y down and z ahead; boxes stand on their bases.
            let (base_z, rotation) = (number(2) - number(5) / 2.0, -number(6) - FRAC_PI_2);
            let is_it = |label: &Vec<&str>| {
                let near =
                    |i: usize, other: f64| (label[i].parse::<f64>().unwrap() - other).abs() < 0.011;
                near(11, -number(1)) && near(12, -base_z) && near(13, number(0))
            };
            if let Some(label) = ahead.next_if(is_it) {
                let found = label[14].parse::<f64>().unwrap() - rotation;
                assert!((found.cos() - 1.0).abs() < 1e-3, "{label:?}: {line}");
                assert_eq!(label[0], if words[7] == "car" { "Car" } else { "Pedestrian" });
                n_hidden += usize::from(label[2] != "0");
            }
        }
        assert_eq!(ahead.next(), None, "{name}: a label that is no box");
    }
    assert!(n_boxes > 60 && n_inside * 100 >= n_points * 99, "{n_inside} of {n_points}");
    assert!(n_hidden > 0, "nothing hides anything");
    let sequence = |file| folder.text(&format!("semantickitti/semantickitti/sequences/00/{file}"));
    assert_eq!(sequence("poses.txt"), "1 0 0 0 0 1 0 0 0 0 1 0\n".repeat(9));
    assert_eq!(sequence("times.txt").lines().nth(8), Some("8.000000e-1"));
    assert!(sequence("calib.txt").contains("\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n"));
}

/// Parts on any number of machines, joined, are one run byte for byte.
#[test]
fn parts_of_scenes_are_one_run_when_they_are_joined() {
    let folder = Folder::new();
    folder.write("cars.toml", CARS);
    let words = "gen-scenes cars.toml --adapter cpu --sweeps 11 --save 4";
    for (layout, of) in [("semantickitti", 3), ("openpcdet", 2), ("kitti", 3)] {
        let words = format!("{words} --layout {layout}");
        folder.succeeds(&format!("{words} --out {layout}"));
        // In any order.
        let parts: Vec<_> = (1..=of).rev().map(|n| format!("{layout}-{n}-of-{of}")).collect();
        for (n, part) in (1..=of).rev().zip(&parts) {
            folder.succeeds(&format!("{words} --shard {n}/{of} --out {part}"));
        }
        folder.succeeds(&format!("merge-dataset {} --out whole-{layout}", parts.join(" ")));
        folder.assert_same_tree(layout, &format!("whole-{layout}"));
    }
    let kitti = ["kitti-1-of-3", "kitti-2-of-3", "kitti-3-of-3"];
    folder.succeeds(&format!("{words} --shard 3/3 --out plain"));
    folder.succeeds(&format!("{words} --shard 3/3 --seed 4 --layout kitti --out other"));
    for (parts, said) in [
        (format!("{} {}", kitti[0], kitti[2]), "part 2/3 is not among the shards"),
        (format!("{} {} plain", kitti[0], kitti[1]), "plain: differs from kitti-1-of-3: "),
        (
            format!("{} {} other", kitti[0], kitti[1]),
            "other: differs from kitti-1-of-3: seed: 4 ag",
        ),
        (format!("{} kitti", kitti[0]), "part.json"),
    ] {
        folder.refuses(1, &[(&format!("merge-dataset {parts} --out none"), said)]);
    }
    let few = "gen-scenes cars.toml --adapter cpu --sweeps 2 --shard 1/3 --out none";
    folder.refuses(2, &[(few, "--shard: expected at most 2 parts, one a sweep, found 3")]);
    assert!(!folder.at("none").exists());
}

/// Rows of f32, little-endian.
fn rows<const N: usize>(bytes: &[u8]) -> Vec<[f32; N]> {
    let numbers = bytes.as_chunks::<4>().0.iter().map(|x| f32::from_le_bytes(*x));
    numbers.collect::<Vec<_>>().as_chunks::<N>().0.to_vec()
}
