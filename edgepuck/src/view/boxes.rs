//! Boxes in the JSON files of `detect`, `live` and `gen-scenes`.

use super::frame::Placed;
use formats::FormatError;
use formats::geometry::{OrientedBox, Pose};
use formats::plausible::read_text;
use serde::Deserialize;
use std::fmt::Display;
use std::path::Path;

/// The farthest that a box may be, which holds UTM coordinates, and its largest size, metres.
const FARTHEST_M: f64 = 1e7;

/// A file of one sweep.
#[derive(Deserialize)]
struct OfSweep {
    objects: Vec<Object>,
    /// Of `detect`: the name of the file of the points.
    sweep: Option<String>,
    /// Of `gen-scenes`, whose objects stand in the street's frame.
    sensor_pose: Option<Pose>,
}

/// An object of any of the commands; each writes some of these keys.
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
    whole_box: Option<OrientedBox>,
    r#box: Option<OrientedBox>,
    /// Beside the size and the direction: the middle, or of `gen-scenes` that of the base.
    #[serde(alias = "centre_m")]
    position_m: Option<[f64; 3]>,
    size_m: Option<[f64; 3]>,
    yaw_deg: Option<f64>,
    /// Of `gen-scenes --drive`; of `live` that of the last point.
    #[serde(alias = "last_s")]
    time_s: Option<f64>,
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
        let cause = format!("expected boxes as of detect, live or gen-scenes: {error}");
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
    let OfSweep { objects, sweep, sensor_pose } =
        serde_json::from_str(&text).map_err(|error| flaw("objects", &error))?;
    let is_seen = |object: &Object| sensor_pose.is_none() || object.points != Some(0);
    let objects = (0..).zip(objects).filter(|(_, object)| is_seen(object));
    let placed = objects.map(|(i, object): (usize, Object)| {
        let placed = object.placed(false);
        let placed = placed.map_err(|cause| flaw(&format!("objects[{i}]"), &cause))?;
        Ok(match sensor_pose {
            Some(pose) => truth_seen_from(pose, placed),
            None => Placed { sweep: sweep.clone(), ..placed },
        })
    });
    placed.collect()
}

impl Object {
    fn placed(self, in_world: bool) -> Result<Placed, &'static str> {
        let own = || {
            let (centre_m, size_m) = (self.position_m?, self.size_m?);
            Some(OrientedBox { centre_m, size_m, yaw_rad: self.yaw_deg?.to_radians() })
        };
        let place = self.whole_box.or(self.r#box).or_else(own).ok_or(
            "found neither `whole_box` nor `box`, nor the three of `position_m`, `size_m` and \
             `yaw_deg`",
        )?;
        let is_sound = place.size_m.iter().all(|size| (0.0..=FARTHEST_M).contains(size))
            && place.centre_m.iter().all(|x| x.abs() <= FARTHEST_M);
        if !is_sound {
            return Err("expected metres up to 1e7, and no size below 0");
        }
        Ok(Placed {
            class: self.class,
            place,
            score: self.probability.or(self.confidence),
            track: self.track.or(self.object),
            truth: false,
            turn: self.turn,
            sweep: None,
            in_world,
            seen_from: None,
            time_s: self.time_s,
        })
    }
}

/// The truth of a box with this base in the street's frame, from the sensor.
fn truth_seen_from(pose: Pose, mut placed: Placed) -> Placed {
    placed.place.centre_m[2] += 0.5 * placed.place.size_m[2];
    Placed { place: placed.place.seen_from(&pose), truth: true, ..placed }
}
