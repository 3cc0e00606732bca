//! `gen-scenes --drive`: a drive as a capture with its ground truth, and as a sequence.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use formats::velodyne::{Decoder, Header, Model};
use infer_cpu::live::Trajectory;
use serde_json::Value;

use crate::Folder;

const WALLS: &str = include_str!("inputs/walls.toml");

#[test]
fn a_drive_comes_back_from_its_packets_when_the_sensors_motion_is_undone() {
    let folder = Folder::new();
    folder.write("walls.toml", WALLS);
    let said = folder
        .succeeds("gen-scenes walls.toml --drive 0.4 --speed 20 --seed 1 --out drives/a.pcap");
    assert!(said.contains("0.4 s, ") && said.contains("drives/a.pcap"), "{said}");
    let truth = folder.text("drives/a.truth.jsonl");
    let truth: Vec<Value> = truth.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let motion = Trajectory::load(&folder.at("drives/a.tum")).unwrap();
    let decoder = Decoder::new(Model::Vlp32c);
    // Points of a wall, in the sensor's frame and in the world.
    let (mut n, mut n_inside, mut n_inside_as_seen) = (0u32, 0u32, 0u32);
    let mut packets = 0;
    formats::pcap::read(&folder.at("drives/a.pcap"), |packet| {
        let header = Header::parse(&packet.payload).unwrap();
        let start_s = packet.time_s.unwrap();
        // The second hour of the year 2000: drives of other seeds begin at other hours.
        assert_eq!(f64::from(header.time_us), ((start_s - 946_688_400.0) * 1e6).round());
        packets += 1;
        decoder
            .decode(&packet.payload, |found| {
                let [x, y, z] = found.point_m.map(f64::from);
                let at = [x, y, z].into();
                let pose = motion.at(start_s + found.after_us * 1e-6);
                // The position if the sensor had not moved since the first packet.
                let [moved, still] = [pose, motion.at(0.0)].map(|p| p.to_world(at).to_array());
                if moved[2] > 0.3 {
                    n += 1;
                    n_inside += u32::from(truth.iter().any(|wall| holds(wall, moved, 0.03)));
                    n_inside_as_seen +=
                        u32::from(truth.iter().any(|wall| holds(wall, still, 0.03)));
                }
            })
            .unwrap();
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(packets, 603, "0.4 s of packets of 663.552 us");
    assert!(n > 3000, "{n} points above the ground");
    assert_eq!(n_inside, n);
    assert!(f64::from(n_inside_as_seen) < 0.9 * f64::from(n), "{n_inside_as_seen} of {n}");
}

/// Whether a point of the world is on an object of the ground truth. Packets have distances in steps
/// of 4 mm and azimuths in steps of 0.01 degrees, which are 5 mm at 30 m. Vertices, and the points of
/// sequences, are rounded by less than a millimetre.
fn holds(wall: &Value, at: [f64; 3], margin_m: f64) -> bool {
    let number = |value: &Value| value.as_f64().unwrap();
    let (sin, cos) = number(&wall["yaw_deg"]).to_radians().sin_cos();
    let off = [0, 1, 2].map(|axis| at[axis] - number(&wall["centre_m"][axis]));
    let along = [cos * off[0] + sin * off[1], cos * off[1] - sin * off[0], off[2]];
    (0..3).all(|axis| along[axis].abs() < number(&wall["size_m"][axis]) / 2.0 + margin_m)
}

/// Cars that stand and cars that move, on a street with a slope, past a sensor that is tilted and
/// sways.
const CARS: &str = include_str!("inputs/cars.toml");

/// The sequence's own poses move each point on a car to the car's box in the truth of the capture of the same
/// drive, whose first pose they are relative to: the capture and the sequence have the same objects.
#[test]
fn points_of_a_sequence_lie_on_their_objects_when_its_poses_move_them() {
    let folder = Folder::new();
    folder.write("cars.toml", CARS);
    let drive = "gen-scenes cars.toml --drive 0.65 --speed 15";
    folder.succeeds(&format!("{drive} --out a.pcap"));
    folder.succeeds(&format!("{drive} --layout semantickitti --out sequences/04"));
    let motion = Trajectory::load(&folder.at("a.tum")).unwrap();
    let truth = folder.text("a.truth.jsonl");
    let truth = truth.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let key = |seen: &Value| ["turn", "object"].map(|key| seen[key].as_u64().unwrap());
    let truth: BTreeMap<[u64; 2], Value> = truth.map(|seen| (key(&seen), seen)).collect();
    let text = |file: &str| folder.text(&format!("sequences/04/{file}"));
    assert!(text("calib.txt").ends_with("\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n"));
    let times: Vec<f64> = text("times.txt").lines().map(|time| time.parse().unwrap()).collect();
    assert_eq!(times, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5], "whole turns");
    let poses = text("poses.txt");
    assert!(poses.starts_with("1 0 0 0 0 1 0 0 0 0 1 0\n"), "{poses}");
    // The middle of a turn is a time of the poses of the capture, which are written to a micrometre.
    let first = motion.at(946_684_800.05);
    let (mut n, mut classes) = (0, BTreeSet::new());
    for (turn, pose) in poses.lines().enumerate() {
        let pose: Vec<f64> = pose.split(' ').map(|word| word.parse().unwrap()).collect();
        let points: Vec<[f32; 4]> = rows(&folder, &format!("velodyne/{turn:06}.bin"));
        let labels: Vec<[f32; 1]> = rows(&folder, &format!("labels/{turn:06}.label"));
        assert_eq!(points.len(), labels.len());
        for ([x, y, z, _], [label]) in points.into_iter().zip(labels) {
            let [class, instance] = [label.to_bits() & 0xFFFF, label.to_bits() >> 16];
            classes.insert(class);
            // To the camera, to the first camera, and from that to the first sensor.
            let camera = [-y, -z, x].map(f64::from);
            let row = |i: usize| {
                (0..3).map(|k| pose[4 * i + k] * camera[k]).sum::<f64>() + pose[4 * i + 3]
            };
            let at = first.to_world([row(2), -row(0), -row(1)].into()).to_array();
            let Some(car) = truth.get(&[turn as u64, instance.into()]) else {
                assert_eq!((class, instance), (49, 0), "neither a car nor ground");
                continue;
            };
            let is_still = car["velocity_m_s"] == serde_json::json!([0.0, 0.0, 0.0]);
            assert_eq!(class, if is_still { 10 } else { 252 }, "car and moving car of its labels");
            if is_still {
                n += 1;
                assert!(holds(car, at, 2e-3), "{at:?} of {car}");
            }
        }
    }
    assert!(n > 1000, "{n} points on cars that stand");
    assert_eq!(classes, [10, 49, 252].into());

    let said = folder.exits(2, &format!("{drive} --layout semantickitti --out sequences/04"));
    assert!(said.contains("sequences/04: it exists already: --overwrite replaces it"), "{said}");
    // Another sensor, of which no packets are written; its sequence is the same every time.
    let other = "gen-scenes cars.toml --sensor hdl64e --drive 0.2 --layout semantickitti --out";
    for out in ["sequences/04 --overwrite", "sequences/05"] {
        folder.succeeds(&format!("{other} {out}"));
    }
    // Neither a folder of sequences nor a recorded one is replaced.
    folder.write("kitti/velodyne/000000.bin", "");
    folder.write("kitti/calib.txt", "P0: 7.2e+02 0 6.1e+02 0 0 7.2e+02 1.9e+02 0 0 0 1 0\n");
    for out in ["sequences", "kitti"] {
        let said = folder.exits(2, &format!("{other} {out} --overwrite"));
        assert!(said.contains("expected only files that this command wrote"), "{said}");
    }
    assert!(!folder.at("sequences/04/velodyne/000002.bin").exists());
    for file in ["velodyne/000001.bin", "labels/000001.label", "poses.txt"] {
        let [one, again] =
            ["04", "05"].map(|number| folder.bytes(&format!("sequences/{number}/{file}")));
        assert!(one == again && !one.is_empty(), "{file}");
    }
}

/// Raindrops are outliers of SemanticKITTI, and of no object.
#[test]
fn points_in_the_air_are_of_no_object_of_a_sequence() {
    let folder = Folder::new();
    let rain = "effects = { noise = { sigma_m = 0 }, weather = { rain_mm_h = 50 } }";
    folder.write("rain.toml", CARS.replace("effects = { noise = { sigma_m = 0 } }", rain));
    folder.succeeds("gen-scenes rain.toml --drive 0.1 --layout semantickitti --out sequences/04");
    let labels: Vec<[f32; 1]> = rows(&folder, "labels/000000.label");
    let outliers = labels.iter().filter(|[label]| label.to_bits() == 1).count();
    assert!((10..labels.len() / 2).contains(&outliers), "{outliers} of {}", labels.len());
}

/// Rows of 32-bit numbers of a file of the sequence, little-endian.
fn rows<const N: usize>(folder: &Folder, file: &str) -> Vec<[f32; N]> {
    let bytes = folder.bytes(&format!("sequences/04/{file}"));
    let numbers = bytes.as_chunks::<4>().0.iter().map(|x| f32::from_le_bytes(*x));
    numbers.collect::<Vec<_>>().as_chunks::<N>().0.to_vec()
}
