//! Boxes around objects, in the files of `detect`, `live`, `gen-scenes`, KITTI and nuScenes.
//!
//! | file | what |
//! | --- | --- |
//! | `.json` with `objects` | of one sweep: of `detect`, or the truth of `gen-scenes` |
//! | `.jsonl` | a line for each object and turn: of `live`, or the truth of `gen-scenes --drive` |
//! | `.txt` | a line for each object: KITTI's labels or results, in the frame of the camera |
//! | `.json` with `results` | of many samples: as nuScenes' results, by the token of each |

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;

use serde::Deserialize;

use crate::error::FormatError;
use crate::geometry::{OrientedBox, Pose};
use crate::plausible::read_text;

/// The farthest that a box may be, which holds UTM coordinates, and its largest size, metres.
const FARTHEST_M: f64 = 1e7;

/// A box around an object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoxOfFile {
    /// Its class, as the file names it.
    pub class: Option<String>,
    /// Where it is.
    pub place: OrientedBox,
    /// The confidence, 0 to 1.
    pub score: Option<f64>,
    /// The number of its track, or of the object.
    pub track: Option<u64>,
    /// The number of its points.
    pub n_points: Option<u64>,
    /// Whether it is labelled, and not detected.
    pub is_truth: bool,
    /// The number of the turn.
    pub turn: Option<u64>,
    /// The name of the file of its points, or the token of its sample.
    pub sweep: Option<String>,
    /// Whether its frame is the world's, and not the sensor's.
    pub in_world: bool,
    /// When it was there: Unix time in seconds.
    pub time_s: Option<f64>,
    /// How fast it moved, metres a second.
    pub velocity_m_s: Option<[f64; 3]>,
}

/// A file of one sweep, of `detect` or `gen-scenes`, or one of nuScenes' results.
#[derive(Deserialize)]
struct Document {
    objects: Option<Vec<Object>>,
    /// Of `detect`: the name of the file of the points.
    sweep: Option<String>,
    /// Of `gen-scenes`, whose objects stand in the street's frame.
    sensor_pose: Option<Pose>,
    results: Option<BTreeMap<String, Vec<OfNuScenes>>>,
}

/// An object of any of our commands; each writes some of these keys.
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
    velocity_m_s: Option<[f64; 3]>,
    /// Of `gen-scenes --drive`; of `live` those of the first and the last point.
    time_s: Option<f64>,
    first_s: Option<f64>,
    last_s: Option<f64>,
}

/// An object of nuScenes' results, or of its annotations in the same form.
#[derive(Deserialize)]
struct OfNuScenes {
    translation: [f64; 3],
    /// Width, length, height.
    size: [f64; 3],
    /// A quaternion w x y z.
    rotation: [f64; 4],
    #[serde(alias = "tracking_name")]
    detection_name: String,
    #[serde(alias = "tracking_score")]
    detection_score: Option<f64>,
    #[serde(alias = "num_lidar_pts")]
    num_pts: Option<i64>,
    #[serde(alias = "instance_token")]
    tracking_id: Option<String>,
}

/// Reads the boxes in `file`.
///
/// # Errors
/// A file that is none of these, a box without a place, or of no possible size.
pub fn read_boxes(file: &Path) -> Result<Vec<BoxOfFile>, FormatError> {
    let text = read_text(file, u64::MAX).map_err(|source| FormatError::io(file, source))?;
    let flaw = |key: &str, error: &dyn Display| {
        let cause =
            format!("expected boxes as of detect, live, gen-scenes, KITTI or nuScenes: {error}");
        FormatError::malformed(file, key, cause)
    };
    let is = |extension: &str| {
        file.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
    };
    let lines = || (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    if is("jsonl") {
        let boxes = lines().map(|(number, line)| {
            let key = format!("line {number}");
            let object: Object = serde_json::from_str(line).map_err(|error| flaw(&key, &error))?;
            object.placed().map_err(|cause| flaw(&key, &cause))
        });
        return boxes.collect();
    }
    if is("txt") {
        let boxes = lines().map(|(number, line)| {
            of_kitti(line).map_err(|cause| flaw(&format!("line {number}"), &cause))
        });
        return boxes.collect();
    }
    let Document { objects, sweep, sensor_pose, results } =
        serde_json::from_str(&text).map_err(|error| flaw("objects", &error))?;
    if let Some(results) = results {
        let each = results.into_iter().flat_map(|(token, boxes)| {
            boxes
                .into_iter()
                .map(move |one| BoxOfFile { sweep: Some(token.clone()), ..one.placed() })
        });
        return Ok(each.collect());
    }
    let objects =
        objects.ok_or_else(|| flaw("objects", &"found neither `objects` nor `results`"))?;
    let is_seen = |object: &Object| sensor_pose.is_none() || object.points != Some(0);
    let objects = (0..).zip(objects).filter(|(_, object)| is_seen(object));
    let boxes = objects.map(|(i, object): (usize, Object)| {
        let one = object.placed().map_err(|cause| flaw(&format!("objects[{i}]"), &cause))?;
        let in_world = false;
        Ok(match sensor_pose {
            Some(pose) => BoxOfFile { in_world, ..truth_seen_from(pose, one) },
            None => BoxOfFile { in_world, sweep: sweep.clone(), ..one },
        })
    });
    boxes.collect()
}

impl Object {
    fn placed(self) -> Result<BoxOfFile, &'static str> {
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
        Ok(BoxOfFile {
            class: self.class,
            place,
            score: self.probability.or(self.confidence),
            track: self.track.or(self.object),
            n_points: self.points,
            is_truth: false,
            turn: self.turn,
            sweep: None,
            in_world: self.frame.as_deref() != Some("sensor"),
            time_s: self.time_s.or_else(|| Some(0.5 * (self.first_s? + self.last_s?))),
            velocity_m_s: self.velocity_m_s,
        })
    }
}

/// The truth of a box with this base in the street's frame, from the sensor.
fn truth_seen_from(pose: Pose, mut one: BoxOfFile) -> BoxOfFile {
    one.place.centre_m[2] += 0.5 * one.place.size_m[2];
    BoxOfFile { place: one.place.seen_from(&pose), is_truth: true, ..one }
}

impl OfNuScenes {
    fn placed(self) -> BoxOfFile {
        let [w, x, y, z] = self.rotation;
        let yaw_rad = libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
        let [width_m, length_m, height_m] = self.size;
        let size_m = [length_m, width_m, height_m];
        BoxOfFile {
            class: Some(self.detection_name),
            place: OrientedBox { centre_m: self.translation, size_m, yaw_rad },
            // Annotations have none, or -1.
            score: self.detection_score.filter(|score| *score >= 0.0),
            // Any number that the same text always has.
            track: self.tracking_id.map(|id| id.parse().unwrap_or_else(|_| number_of(&id))),
            n_points: self.num_pts.and_then(|n| u64::try_from(n).ok()),
            in_world: true,
            ..BoxOfFile::default()
        }
    }
}

/// FNV-1a of the bytes of `text` (Fowler, Noll and Vo), 64 bits.
fn number_of(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// A line of KITTI's labels or results: type, truncation, occlusion, alpha, 4 numbers of the picture,
/// height, width, length, x, y, z of the base and rotation, and the score. The frame is a
/// camera's: x to the right, y down, z ahead.
fn of_kitti(line: &str) -> Result<BoxOfFile, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    if !(15..=16).contains(&words.len()) {
        return Err(format!(
            "expected 15 words of KITTI's labels, or 16 with a score, found {}",
            words.len()
        ));
    }
    let number = |at: usize| {
        let found = words[at].parse().ok().filter(|x: &f64| x.is_finite());
        found.ok_or_else(|| format!("expected a number as word {}, found {}", at + 1, words[at]))
    };
    let [height_m, width_m, length_m, x, y, z, rotation] = {
        let mut numbers = [0.0; 7];
        for (at, value) in numbers.iter_mut().enumerate() {
            *value = number(8 + at)?;
        }
        numbers
    };
    Ok(BoxOfFile {
        class: Some(words[0].to_owned()),
        place: OrientedBox {
            centre_m: [z, -x, 0.5 * height_m - y],
            size_m: [length_m, width_m, height_m],
            yaw_rad: -rotation - std::f64::consts::FRAC_PI_2,
        },
        score: words.get(15).map(|_| number(15)).transpose()?,
        is_truth: words.len() == 15,
        ..BoxOfFile::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A car 10 m ahead of the camera that drives away, 2 m to the left, on ground 1.5 m below.
    #[test]
    fn labels_of_kitti_are_turned_to_x_ahead_and_z_up() {
        let line = "Car 0 0 -1.57 1 2 3 4 1.4 1.6 4.2 -2.0 1.5 10.0 -1.5707963 0.8";
        let one = of_kitti(line).unwrap();
        assert_eq!(
            (one.class.as_deref(), one.score, one.is_truth),
            (Some("Car"), Some(0.8), false)
        );
        let OrientedBox { centre_m, size_m, yaw_rad } = one.place;
        assert_eq!((centre_m, size_m), ([10.0, 2.0, 0.7 - 1.5], [4.2, 1.6, 1.4]));
        assert!(yaw_rad.abs() < 1e-7);
        assert!(of_kitti("Car 0 0").unwrap_err().contains("found 3"));
        let wrong = line.replace("4.2", "x");
        assert!(of_kitti(&wrong).unwrap_err().contains("word 11, found x"));
    }

    #[test]
    fn boxes_of_nuscenes_have_their_length_second() {
        let text = r#"{"translation": [1, 2, 3], "size": [2, 4, 1.5], "rotation": [0.70710678, 0, 0, 0.70710678],
            "detection_name": "car", "detection_score": -1.0, "num_pts": 7, "tracking_id": "a"}"#;
        let one = serde_json::from_str::<OfNuScenes>(text).unwrap().placed();
        assert_eq!((one.place.size_m, one.score, one.n_points), ([4.0, 2.0, 1.5], None, Some(7)));
        assert!((one.place.yaw_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-7);
        // The published hash of "a".
        assert_eq!(one.track, Some(0xaf63_dc4c_8601_ec8c));
    }
}
