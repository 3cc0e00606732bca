//! `calibrate`: sensors of known noise, dropout and quantum, and a real one.

use crate::Folder;
use serde_json::Value;
use std::fs;
use test_support::{need, shared_data};

const SENSORS: [&str; 5] = ["vlp16", "vlp32c", "os1-128", "xt32", "hdl32e"];
const TURNS: u32 = 5;

/// A room of 30 by 16 by 8 m that is open to the sky, with two boxes in it.
fn room() -> String {
    let boxes = [
        ([0.0, 0.0, 2.0], [30.0, 16.0, 8.0], 1),
        ([5.0, 3.0, -1.0], [2.0, 2.0, 2.0], 6),
        ([-3.0, -2.0, -1.0], [1.0, 1.0, 2.0], 6),
    ];
    let sides =
        [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (centre, size, open) in boxes {
        let first = vertices.len();
        for z in [-0.5, 0.5] {
            for [x, y] in [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] {
                let [a, b, c] =
                    [(0, x), (1, y), (2, z)].map(|(axis, at)| centre[axis] + at * size[axis]);
                vertices.push(format!("{a} {b} {c}\n"));
            }
        }
        for (_, side) in sides.iter().enumerate().filter(|(side, _)| *side != open) {
            let [a, b, c, d] = side.map(|corner| first + corner);
            faces.push(format!("3 {a} {b} {c}\n3 {a} {c} {d}\n"));
        }
    }
    let counts = format!("OFF\n{} {} 0\n", vertices.len(), 2 * faces.len());
    counts + &vertices.concat() + &faces.concat()
}

/// Scans the room from one place in turn after turn, and calibrates each sensor: its profile in
/// `profiles` is `before` and the name, and the one that is written `after` and the name.
fn calibrate(
    folder: &Folder,
    sensors: &[&str],
    effects: &str,
    before: &str,
    after: &str,
) -> Vec<Value> {
    folder.write("room.off", room());
    for turn in 0..TURNS {
        let end = if before.is_empty() { "" } else { ".toml" };
        let mut scene = format!(
            "seed = {}\nattributes = [\"range\", \"ring\", \"time\", \"intensity\"]\n[effects]\n\
             intensity = true\nquantise_m = true\n{effects}\n[[object]]\nmesh = \"room.off\"\n",
            if before.is_empty() { 1 + turn } else { 101 + turn }
        );
        for name in sensors {
            scene += &format!(
                "[[sensor]]\nname = \"{name}\"\nprofile = \"{before}{name}{end}\"\n\
                 position_m = [0.7, 0.3, 0.1]\nyaw_deg = 20\n"
            );
        }
        folder.write("scene.toml", scene);
        folder.succeeds(&format!("scan scene.toml --adapter cpu --out {after}{turn}.npz"));
    }
    let figures = |name: &&str| {
        let sweeps: Vec<_> = (0..TURNS).map(|turn| format!("{after}{turn}_{name}.npz")).collect();
        let sweeps = sweeps.join(" ");
        let words = format!("calibrate {sweeps} --sensor {name} --json --out {after}{name}.toml");
        json(folder, &words)
    };
    sensors.iter().map(figures).collect()
}

fn json(folder: &Folder, words: &str) -> Value {
    let output = folder.edgepuck(words).output().unwrap();
    assert!(output.status.success(), "{words}: {}", crate::said(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn ends(figure: &Value) -> [f64; 3] {
    ["low", "value", "high"].map(|key| figure[key].as_f64().unwrap())
}

/// Asserts that `expected` is within one and a half of the 95 % interval, 99.7 %.
fn assert_near(figure: &Value, expected: f64, what: &str) {
    let [low, value, high] = ends(figure);
    let is_near = (1.5 * (low - value)..=1.5 * (high - value)).contains(&(expected - value));
    assert!(is_near, "{what}: expected {expected}, found {figure}");
}

#[test]
fn five_sensors_are_found_as_they_were_simulated_and_once_more_by_their_profiles() {
    let folder = Folder::new();
    let effects = "noise = { sigma_m = 0.011 }\ndropout = { probability = 0.03 }";
    let first = calibrate(&folder, &SENSORS, effects, "", "a-");
    let quanta_m = [0.002, 0.004, 0.001, 0.004, 0.002];
    for ((name, found), quantum_m) in SENSORS.iter().zip(&first).zip(quanta_m) {
        assert_near(&found["repeatability_m"], 0.011, name);
        assert_near(&found["missing"], 0.03, name);
        assert_near(&found["rpm"], 600.0, name);
        let quantum = found["quantum_m"]["value"].as_f64().unwrap();
        assert!((quantum / quantum_m - 1.0).abs() < 1e-5, "{name}: {quantum}");
        for key in ["by_range", "by_ring"] {
            let parts = found[key].as_array().unwrap();
            assert!(parts.len() > 2, "{name}: {key}");
            // Of some 250 intervals, a few are beside the value.
            let is_far = |part: &&Value| {
                let [low, value, high] = ends(&part["repeatability_m"]);
                !(2.0 * (low - value)..=2.0 * (high - value)).contains(&(0.011 - value))
            };
            assert!(parts.iter().filter(is_far).count() <= 1, "{name}: {key}");
        }
        // The room ends 18 m from the sensor, at its far corners.
        assert!(found["largest_range_m"].as_f64().unwrap() < 19.0, "{name}");
        // The sensor reaches as far as before.
        let most_m = |text: &str| {
            text.lines().find_map(|line| {
                line.strip_prefix("max_m = ")?.split(' ').next()?.parse::<f64>().ok()
            })
        };
        let before =
            fs::read_to_string(crate::in_repository(&format!("assets/sensors/{name}.toml")))
                .unwrap();
        assert_eq!(most_m(&folder.text(&format!("a-{name}.toml"))), most_m(&before), "{name}");
    }
    let told = folder.succeeds("profile a-os1-128.toml");
    assert!(told.contains("0.03 m, 0.01") && told.contains("131072"), "{told}");

    let noise_m = first[0]["repeatability_m"]["value"].as_f64().unwrap();
    let dropout = first[0]["missing"]["value"].as_f64().unwrap();
    let effects =
        format!("noise = {{ sigma_m = {noise_m} }}\ndropout = {{ probability = {dropout} }}");
    let sensors = ["vlp16", "hdl32e"];
    let again = calibrate(&folder, &sensors, &effects, "a-", "b-");
    for (name, found) in sensors.iter().zip(&again) {
        assert_near(&found["repeatability_m"], noise_m, name);
        assert_near(&found["missing"], dropout, name);
        assert_near(&found["rpm"], 600.0, name);
    }
}

#[test]
fn a_capture_is_calibrated_to_its_profile() {
    let folder = Folder::new();
    let vlp32c = fs::read_to_string(crate::in_repository("assets/sensors/vlp32c.toml")).unwrap();
    let quiet = vlp32c.replace("repeatability_m = 0.006", "repeatability_m = 0.015");
    assert_ne!(quiet, vlp32c);
    folder.write("known.toml", quiet);
    let drive = "gen-scenes room --seed 7 --drive 0.85";
    folder.succeeds(&format!("{drive} --speed 0 --sensor known.toml --out rest.pcap"));
    let first = json(&folder, "calibrate rest.pcap --json --out found.toml");
    // Furniture, whose ranges are not known between two firings, adds up to 2 %.
    let [low, _, high] = ends(&first["repeatability_m"]);
    assert!(low < 1.02 * 0.015 && high > 0.015, "{first}");
    assert!(ends(&first["missing"])[0] < 1e-3, "{first}");
    assert_eq!(first["turns"], 8);

    folder.succeeds(&format!("{drive} --speed 0 --sensor found.toml --out again.pcap"));
    let again = json(&folder, "calibrate rest.pcap again.pcap --json --out both.toml");
    assert_eq!(again["turns"], 17);
    let [low, _, high] = ends(&again["repeatability_m"]);
    assert!(low < 1.03 * 0.015 && high > 0.015, "{again}");

    let vlp16 = fs::read_to_string(crate::in_repository("assets/sensors/vlp16.toml")).unwrap();
    folder.write("twice.toml", format!("revolutions = 2\n{vlp16}"));
    folder.write("room.off", room());
    folder.succeeds("scan room.off --adapter cpu --distance 1 --sensor twice.toml --out twice.npz");
    let twice = "calibrate twice.npz twice.npz --sensor vlp16 --out x.toml";
    folder.refuses(2, &[(twice, "found several turns in a file")]);
}

/// What a second difference of neighbouring firings has is 5 to 7 mm: from turn to turn it is more.
#[test]
fn a_real_vlp16_is_calibrated() {
    let file = need!(shared_data("real_scans/vlp16_packets_1206B.bin"));
    let folder = Folder::new();
    let packets = fs::read(file).unwrap();
    folder.write("real.pcap", capture(&packets));
    let found = json(&folder, "calibrate real.pcap --json --out real.toml");
    assert_eq!(found["turns"], 13);
    for (key, expected) in [
        ("repeatability_m", 0.006..0.010),
        ("missing", 0.002..0.02),
        ("rpm", 599.0..601.0),
        ("quantum_m", 0.001_999..0.002_001),
        ("unevenness_deg", 0.0..0.1),
    ] {
        let [_, value, _] = ends(&found[key]);
        assert!(expected.contains(&value), "{key}: {found}");
    }
}

/// Payloads of 1206 bytes in a capture of raw IPv4 packets (LINKTYPE_IPV4).
fn capture(payloads: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for word in [0xa1b2_c3d4, 0x0004_0002, 0, 0, 65_535, 228] {
        bytes.extend(u32::to_le_bytes(word));
    }
    for payload in payloads.chunks_exact(1206) {
        for word in [0, 0, 1234, 1234] {
            bytes.extend(u32::to_le_bytes(word));
        }
        let header = [0x45, 0, 4, 210, 0, 0, 0, 0, 64, 17, 0, 0, 10, 0, 0, 1, 10, 0, 0, 2];
        let udp = [9, 64, 9, 64, 4, 190, 0, 0];
        bytes.extend([&header[..], &udp, payload].concat());
    }
    bytes
}
