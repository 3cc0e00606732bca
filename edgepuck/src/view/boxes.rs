//! Boxes in the JSON files of `detect`, `live`, `gen-scenes` and `gen-drive`.

use super::frame::Placed;
use formats::FormatError;
use formats::foreign::read_text;
use serde::Deserialize;
use sim_gpu::Pose;
use std::fmt::Display;
use std::path::Path;

/// The farthest that a box may be, which holds UTM coordinates, and its largest size, metres.
const FARTHEST_M: f64 = 1e7;

/// A file of one sweep.
#[derive(Deserialize)]
struct OfSweep {
    objects: Vec<Object>,
    /// Of `gen-scenes`, whose objects stand in the street's frame.
    sensor_pose: Option<Pose>,
}

/// What the commands tell of an object; each has its own part of it.
#[derive(Deserialize)]
struct Object {
    class: Option<String>,
    turn: Option<u64>,
    track: Option<u64>,
    object: Option<u64>,
    points: Option<u64>,
    confidence: Option<f64>,
    probability: Option<f64>,
    frame: Option<String>,
    whole_box: Option<Cuboid>,
    r#box: Option<Cuboid>,
    /// Beside the size and the direction: the middle, or of `gen-scenes` that of the base.
    #[serde(alias = "centre_m")]
    position_m: Option<[f64; 3]>,
    size_m: Option<[f64; 3]>,
    yaw_deg: Option<f64>,
    /// Of `gen-drive`; of `live` that of the last point.
    #[serde(alias = "last_s")]
    time_s: Option<f64>,
}

#[derive(Clone, Copy, Deserialize)]
struct Cuboid {
    centre_m: [f64; 3],
    size_m: [f64; 3],
    yaw_deg: f64,
}

/// The truth of the sweep that `gen-scenes` describes in `file`; none if the file is another's.
pub fn described(file: &Path) -> Result<Vec<Placed>, FormatError> {
    let text = read_text(file, u64::MAX).map_err(|source| FormatError::io(file, source))?;
    if text.contains("\"sensor_pose\"") { read(file) } else { Ok(Vec::new()) }
}

/// Reads the boxes in `file`: an object of JSON with all, or a line of JSON for each.
pub fn read(file: &Path) -> Result<Vec<Placed>, FormatError> {
    let text = read_text(file, u64::MAX).map_err(|source| FormatError::io(file, source))?;
    let flaw = |key: &str, error: &dyn Display| {
        let cause = format!("expected boxes as of detect, live, gen-scenes or gen-drive: {error}");
        FormatError::malformed(file, key, cause)
    };
    if file.extension().is_some_and(|found| found.eq_ignore_ascii_case("jsonl")) {
        let lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
        let placed = lines.map(|(number, line)| {
            let key = format!("line {number}");
            let object: Object = serde_json::from_str(line).map_err(|error| flaw(&key, &error))?;
            let in_world = object.frame.as_deref() != Some("sensor");
            object.placed(in_world).map_err(|cause| flaw(&key, &cause))
        });
        return placed.collect();
    }
    let OfSweep { objects, sensor_pose } =
        serde_json::from_str(&text).map_err(|error| flaw("objects", &error))?;
    let is_seen = |object: &Object| sensor_pose.is_none() || object.points != Some(0);
    let objects = (0..).zip(objects).filter(|(_, object)| is_seen(object));
    let placed = objects.map(|(i, object): (usize, Object)| {
        let placed = object.placed(false);
        let placed = placed.map_err(|cause| flaw(&format!("objects[{i}]"), &cause))?;
        Ok(match sensor_pose {
            Some(pose) => truth_seen_from(pose, placed),
            None => placed,
        })
    });
    placed.collect()
}

impl Object {
    fn placed(self, in_world: bool) -> Result<Placed, &'static str> {
        let own = || {
            let (centre_m, size_m) = (self.position_m?, self.size_m?);
            Some(Cuboid { centre_m, size_m, yaw_deg: self.yaw_deg? })
        };
        let Cuboid { centre_m, size_m, yaw_deg } =
            self.whole_box.or(self.r#box).or_else(own).ok_or(
                "found neither `whole_box` nor `box`, nor the three of `position_m`, `size_m` and \
                 `yaw_deg`",
            )?;
        let is_sound = size_m.iter().all(|size| (0.0..=FARTHEST_M).contains(size))
            && centre_m.iter().all(|x| x.abs() <= FARTHEST_M);
        if !is_sound {
            return Err("expected metres up to 1e7, and no size below 0");
        }
        Ok(Placed {
            class: self.class,
            centre: centre_m,
            size: size_m,
            yaw: yaw_deg.to_radians(),
            score: self.probability.or(self.confidence),
            track: self.track.or(self.object),
            truth: false,
            turn: self.turn,
            in_world,
            time_s: self.time_s,
        })
    }
}

/// The truth of a box with this base in the street's frame, from the sensor.
fn truth_seen_from(pose: Pose, placed: Placed) -> Placed {
    let [x, y, z] = placed.centre;
    let centre = [x, y, z + 0.5 * placed.size[2]];
    Placed { centre, truth: true, ..placed }.seen_from(pose)
}
