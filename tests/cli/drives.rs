//! `gen-drive`: a drive as a capture, with its ground truth.

use std::ops::ControlFlow;

use formats::velodyne::{Decoder, Header, Model};
use infer_cpu::live::EgoMotion;
use serde_json::Value;

use crate::Folder;

const WALLS: &str = r#"
variants = 2
[ground]
road_width_m = [8, 8]
[mount]
height_m = [1.5, 1.5]
[[sensor]]
profile = "vlp32c"
noise_m = 0
[[object]]
kind = "wall"
class = "wall"
count = [8, 8]
place = "line"
distance_m = [4, 30]
"#;

#[test]
fn a_drive_comes_back_from_its_packets_when_the_sensors_motion_is_undone() {
    let folder = Folder::new();
    folder.write("walls.toml", WALLS);
    let said = folder.succeeds("gen-drive walls.toml --seconds 0.4 --speed 20 --out drives/a.pcap");
    assert!(said.contains("0.4 s, ") && said.contains("drives/a.pcap"), "{said}");
    let truth = folder.text("drives/a.truth.jsonl");
    let truth: Vec<Value> = truth.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let motion = EgoMotion::read(&folder.at("drives/a.tum")).unwrap();
    let decoder = Decoder::new(Model::Vlp32c);
    // Points of a wall, in the sensor's frame and in the world.
    let (mut n, mut n_inside, mut n_inside_as_seen) = (0u32, 0u32, 0u32);
    let mut packets = 0;
    formats::pcap::read(&folder.at("drives/a.pcap"), |packet| {
        let header = Header::parse(&packet.payload).unwrap();
        let start_s = packet.time_s.unwrap();
        assert_eq!(f64::from(header.time_us), ((start_s - 946_684_800.0) * 1e6).round());
        packets += 1;
        decoder
            .decode(&packet.payload, |found| {
                let [x, y, z] = found.point_m.map(f64::from);
                let at = [x, y, z].into();
                let pose = motion.pose(start_s + found.after_us * 1e-6, 0.0);
                // The position if the sensor had not moved since the first packet.
                let [moved, still] =
                    [pose, motion.pose(0.0, 0.0)].map(|p| p.to_world(at).to_array());
                if moved[2] > 0.3 {
                    n += 1;
                    n_inside += u32::from(truth.iter().any(|wall| holds(wall, moved)));
                    n_inside_as_seen += u32::from(truth.iter().any(|wall| holds(wall, still)));
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

/// Whether a point of the world is on a wall of the ground truth. Packets have distances in steps
/// of 4 mm and azimuths in steps of 0.01 degrees, which are 5 mm at 30 m.
fn holds(wall: &Value, at: [f64; 3]) -> bool {
    let number = |value: &Value| value.as_f64().unwrap();
    let (sin, cos) = number(&wall["yaw_deg"]).to_radians().sin_cos();
    let off = [0, 1, 2].map(|axis| at[axis] - number(&wall["centre_m"][axis]));
    let along = [cos * off[0] + sin * off[1], cos * off[1] - sin * off[0], off[2]];
    (0..3).all(|axis| along[axis].abs() < number(&wall["size_m"][axis]) / 2.0 + 0.03)
}

#[test]
fn a_drive_that_cannot_be_made_is_refused_and_leaves_nothing() {
    let folder = Folder::new();
    folder.write("walls.toml", WALLS);
    folder.write("vlp16.toml", WALLS.replace("vlp32c", "vlp16"));
    let refused = |words: &str, code: i32, expected: &str| {
        let said = folder.exits(code, &format!("gen-drive {words}"));
        assert!(said.contains(expected), "{said}");
    };
    refused("walls.toml --seconds 0 --out a.pcap", 2, "expected a number above 0 and up to 86400");
    refused("walls.toml --seconds nan --out a.pcap", 2, "expected a number above 0");
    refused("walls.toml --speed -1 --out a.pcap", 2, "expected a number from 0 to 100");
    refused("walls.toml --out a.npz", 2, "expected a name with .pcap, found a.npz");
    refused("walls.toml --sensor vlp16 --out a.pcap", 1, "vlp16 with the recipe walls.toml: rot");
    refused("absent.toml --out a.pcap", 1, "absent.toml");
    folder.write("taken.pcap/file", "");
    for flag in ["", "--overwrite"] {
        let words = format!("walls.toml --seconds 0.1 --out taken.pcap {flag}");
        refused(&words, 2, "taken.pcap: expected a file to write, found a folder: name another");
    }
    for name in ["a.pcap", "a.tum", "a.truth.jsonl", "taken.tum"] {
        assert!(!folder.at(name).exists(), "{name}");
    }
}
