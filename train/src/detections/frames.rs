//! Detections and labelled objects, frame by frame.

use std::collections::BTreeMap;
use std::path::Path;

use formats::FormatError;
use formats::boxes::{BoxOfFile as Placed, read_boxes};
use formats::geometry::OrientedBox;

/// The longest time between a detection and the object that it may be, seconds: half a turn.
const MOST_APART_S: f64 = 0.06;
/// A turn at 10 Hz, and what the clocks of both files may differ by, seconds.
const TURN_S: f64 = 0.12;

/// Classes of data sets, and what they are here. Those without a name are not judged.
const ALIASES: [(&str, &str); 28] = [
    ("van", "car"),
    ("regular_vehicle", "car"),
    ("pickup", "car"),
    ("pedestrian", "person"),
    ("person_sitting", "person"),
    ("child", "person"),
    ("cyclist", "two-wheeler"),
    ("bicyclist", "two-wheeler"),
    ("bicycle", "two-wheeler"),
    ("motorcycle", "two-wheeler"),
    ("motorcyclist", "two-wheeler"),
    ("box_truck", "truck"),
    ("truck_cab", "truck"),
    ("large_vehicle", "truck"),
    ("trailer", "truck"),
    ("construction_vehicle", "truck"),
    ("school_bus", "bus"),
    ("tram", ""),
    ("dontcare", ""),
    ("misc", ""),
    ("other", ""),
    ("unknown", ""),
    ("animal", ""),
    ("barrier", ""),
    ("traffic_cone", ""),
    ("wheeled_device", ""),
    ("sign", ""),
    ("bollard", ""),
];

/// A detection, or a labelled object.
#[derive(Clone, Debug)]
pub struct Thing {
    /// The index of its class; `None` for what is not judged.
    pub class: Option<usize>,
    pub place: OrientedBox,
    /// The confidence, 0 to 1; 1 if the file has none.
    pub score: f64,
    /// The number of its points, if the file has it.
    pub n_points: Option<u64>,
    /// The number of its file and that of its track, if it has one.
    pub track: Option<(usize, u64)>,
    /// The distance from the sensor, metres, if the place is in its frame.
    pub range_m: Option<f64>,
}

/// Detections and labelled objects of the same frames.
#[derive(Debug, Default)]
pub struct Frames {
    /// The names of the classes, sorted.
    pub classes: Vec<String>,
    /// Of each frame: what was found, and what is there.
    pub of: Vec<[Vec<Thing>; 2]>,
}

/// Reads the detections and the truth of `files`: a pair of files, or of folders whose files have the same
/// names.
///
/// # Errors
/// A file that holds no boxes, a folder whose partner lacks a file, detections in another frame than the truth, and
/// truth without objects.
pub fn read([detections, truth]: [&Path; 2]) -> Result<Frames, FormatError> {
    let pairs = match (detections.is_dir(), truth.is_dir()) {
        (false, false) => vec![[detections.to_path_buf(), truth.to_path_buf()]],
        (true, true) => paired(detections, truth)?,
        (is_folder, _) => {
            let [folder, file] = if is_folder { [detections, truth] } else { [truth, detections] };
            let cause =
                format!("expected two files or two folders, found the folder {}", folder.display());
            return Err(FormatError::malformed(file, "detections and truth", cause));
        }
    };
    let mut classes = Vec::new();
    let mut of = Vec::new();
    for (file, [found, labelled]) in pairs.iter().enumerate() {
        let [boxes, truth] = [read_boxes(found)?, read_boxes(labelled)?];
        if let (Some(a), Some(b)) = (boxes.first(), truth.first())
            && a.in_world != b.in_world
        {
            let frame = |one: &Placed| if one.in_world { "the world's" } else { "the sensor's" };
            let cause = format!(
                "expected boxes in {} frame, as {} has them, found them in {} (live: --poses)",
                frame(b),
                labelled.display(),
                frame(a)
            );
            return Err(FormatError::malformed(found, "frame", cause));
        }
        of.extend(by_frame(file, boxes, truth, &mut classes));
    }
    let mut frames = Frames { classes, of };
    frames.sort_classes();
    match frames.of.iter().all(|[_, labelled]| labelled.is_empty()) {
        false => Ok(frames),
        true => {
            Err(FormatError::malformed(truth, "objects", "expected labelled objects, found none"))
        }
    }
}

/// The files of two folders that have the same names but for their extensions.
fn paired(detections: &Path, truth: &Path) -> Result<Vec<[std::path::PathBuf; 2]>, FormatError> {
    let list = |folder: &Path| -> Result<BTreeMap<String, std::path::PathBuf>, FormatError> {
        let io = |source| FormatError::io(folder, source);
        let mut files = BTreeMap::new();
        for entry in std::fs::read_dir(folder).map_err(io)? {
            let path = entry.map_err(io)?.path();
            let is_boxes = path
                .extension()
                .is_some_and(|end| ["json", "jsonl", "txt"].iter().any(|known| end == *known));
            let Some(stem) = path.file_stem().filter(|_| is_boxes) else { continue };
            let stem = stem.to_string_lossy().into_owned();
            if let Some(other) = files.insert(stem, path.clone()) {
                let cause = format!("expected one file of this name, found {}", other.display());
                return Err(FormatError::malformed(&path, "name", cause));
            }
        }
        Ok(files)
    };
    let (found, mut labelled) = (list(detections)?, list(truth)?);
    let lacks = |folder: &Path, what: &str, stem: &str| {
        let cause = format!("expected the {what} of {stem}, found none");
        FormatError::malformed(folder, "folder", cause)
    };
    let pair = |(stem, file): (String, std::path::PathBuf)| {
        let partner = labelled.remove(&stem).ok_or_else(|| lacks(truth, "truth", &stem))?;
        Ok([file, partner])
    };
    let pairs = found.into_iter().map(pair).collect::<Result<_, _>>()?;
    match labelled.keys().next() {
        None => Ok(pairs),
        Some(stem) => Err(lacks(detections, "detections", stem)),
    }
}

/// The frames of a file of detections and one of the truth: those of samples by their names, those of turns
/// by their numbers or by the times of the objects, and one if they have none of these.
fn by_frame(
    file: usize,
    found: Vec<Placed>,
    labelled: Vec<Placed>,
    classes: &mut Vec<String>,
) -> Vec<[Vec<Thing>; 2]> {
    // In the order of turns, which tells switches of tracks.
    let key = |one: &Placed| match one.turn {
        Some(turn) => (turn, String::new()),
        None if one.in_world => (0, one.sweep.clone().unwrap_or_default()),
        // A file of one sweep.
        None => (0, String::new()),
    };
    let mut frames: BTreeMap<(u64, String), [Vec<Thing>; 2]> = BTreeMap::new();
    for one in &labelled {
        frames.entry(key(one)).or_default()[1].push(thing(file, one, classes));
    }
    for one in found {
        // Turns that are lost, or a capture that begins later, have other numbers: then the turn is that of the
        // nearest object about this time, and the detection is where it was then.
        let is_of_turn = |time_s: f64| {
            let is_near = |there_s: f64| (there_s - time_s).abs() < TURN_S;
            labelled.iter().any(|other| other.turn == one.turn && other.time_s.is_none_or(is_near))
        };
        let (own, one) = match one.time_s.filter(|&time_s| !is_of_turn(time_s)) {
            None => (key(&one), one),
            Some(time_s) => match nearest(&one, time_s, &labelled) {
                None => ((u64::MAX, String::new()), one),
                Some(there) => (key(there), at_time_of(one, there, time_s)),
            },
        };
        frames.entry(own).or_default()[0].push(thing(file, &one, classes));
    }
    if frames.is_empty() {
        frames.entry((0, String::new())).or_default();
    }
    frames.into_values().collect()
}

/// The labelled object about this time that is nearest to `one`.
fn nearest<'a>(one: &Placed, time_s: f64, labelled: &'a [Placed]) -> Option<&'a Placed> {
    let off_m = |other: &Placed| {
        let moved_m = moved_m(other, time_s);
        let there = |axis: usize| one.place.centre_m[axis] - moved_m[axis];
        let off = |axis: usize| there(axis) - other.place.centre_m[axis];
        libm::hypot(off(0), off(1))
    };
    let about = labelled.iter().filter(|other| {
        other.time_s.is_some_and(|there_s| (there_s - time_s).abs() < MOST_APART_S)
    });
    about.min_by(|a, b| off_m(a).total_cmp(&off_m(b)))
}

/// How far an object has moved at this time, metres.
fn moved_m(other: &Placed, time_s: f64) -> [f64; 3] {
    let after_s = time_s - other.time_s.unwrap_or(time_s);
    other.velocity_m_s.unwrap_or_default().map(|speed| after_s * speed)
}

/// Where `one`, which is of this time, was at the time of `other`, if it moved with it.
fn at_time_of(mut one: Placed, other: &Placed, time_s: f64) -> Placed {
    let moved_m = moved_m(other, time_s);
    (0..3).for_each(|axis| one.place.centre_m[axis] -= moved_m[axis]);
    one
}

fn thing(file: usize, one: &Placed, classes: &mut Vec<String>) -> Thing {
    let own = one.class.clone().unwrap_or_default().to_lowercase();
    let alias = ALIASES.iter().find(|(name, _)| *name == own);
    let name = alias.map_or(&*own, |(_, name)| name);
    let class = (!name.is_empty()).then(|| match classes.iter().position(|known| known == name) {
        Some(at) => at,
        None => {
            classes.push(name.to_owned());
            classes.len() - 1
        }
    });
    let Placed { place, n_points, .. } = *one;
    let track = one.track.map(|track| (file, track));
    let [x, y, _] = place.centre_m;
    let range_m = (!one.in_world).then(|| libm::hypot(x, y));
    Thing { class, place, score: one.score.unwrap_or(1.0), n_points, track, range_m }
}

impl Frames {
    fn sort_classes(&mut self) {
        let mut order: Vec<usize> = (0..self.classes.len()).collect();
        order.sort_by(|&a, &b| self.classes[a].cmp(&self.classes[b]));
        let place = |class: usize| order.iter().position(|&at| at == class);
        for one in self.of.iter_mut().flatten().flatten() {
            one.class = one.class.and_then(place);
        }
        self.classes.sort();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(class: &str, x: f64) -> Placed {
        let place = OrientedBox { centre_m: [x, 0.0, 0.0], size_m: [1.0; 3], yaw_rad: 0.0 };
        Placed { class: Some(class.to_owned()), place, in_world: true, ..Placed::default() }
    }

    /// The car moves 1 m in a turn of 0.1 s. Detections name no turn, or behind a gap that of another.
    #[test]
    fn detections_belong_to_the_turn_of_the_nearest_object_about_their_time() {
        let at = |turn: u64| {
            let (time_s, velocity_m_s) = (Some(0.1 * turn as f64), Some([10.0, 0.0, 0.0]));
            Placed { turn: Some(turn), time_s, velocity_m_s, ..boxed("Car", turn as f64) }
        };
        for turns in [[None; 3], [Some(1), Some(7), Some(2)], [Some(1), Some(1), Some(2)]] {
            let times = [(1.0, 0.1), (2.4, 0.24), (9.0, 0.9)];
            let found = times.into_iter().zip(turns).map(|((x, time_s), turn)| Placed {
                time_s: Some(time_s),
                turn,
                ..boxed("car", x)
            });
            let mut classes = Vec::new();
            let frames = by_frame(0, found.collect(), vec![at(1), at(2)], &mut classes);
            let places = frames.iter().map(|[found, labelled]| {
                let x = |one: &Thing| (one.place.centre_m[0] * 1e6).round() / 1e6;
                (found.iter().map(x).collect::<Vec<_>>(), labelled.len())
            });
            // The last is of no turn of the truth.
            assert_eq!(
                places.collect::<Vec<_>>(),
                [(vec![1.0], 1), (vec![2.0], 1), (vec![9.0], 0)],
                "{turns:?}"
            );
            assert_eq!(classes, ["car"]);
        }
    }

    /// Files of lines as `live` and `gen-drive` write them.
    #[test]
    fn files_of_folders_are_paired_and_hold_one_frame() {
        let folder = tempfile::tempdir().unwrap();
        let [found, truth] = ["found", "truth"].map(|name| folder.path().join(name));
        let line = |frame: &str| {
            format!(
                r#"{{"class":"car","turn":0,"track":1,"frame":"{frame}","centre_m":[9,0,0],"size_m":[4,2,2],"yaw_deg":0}}"#
            )
        };
        let write = |place: &Path, text: &str| {
            std::fs::create_dir_all(place.parent().unwrap()).unwrap();
            std::fs::write(place, text).unwrap();
        };
        for name in ["a.jsonl", "b.jsonl"] {
            write(&found.join(name), &line("world"));
            write(&truth.join(name), &line("world"));
        }
        let frames = read([&found, &truth]).unwrap();
        let tracks = frames.of.iter().map(|[found, _]| found[0].track);
        assert_eq!(tracks.collect::<Vec<_>>(), [Some((0, 1)), Some((1, 1))]);
        let refused = || read([&found, &truth]).unwrap_err().to_string();
        write(&truth.join("c.jsonl"), &line("world"));
        assert!(refused().contains("expected the detections of c"), "{}", refused());
        write(&found.join("c.jsonl"), &line("sensor"));
        assert!(refused().contains("--poses"), "{}", refused());
        write(&found.join("b.json"), &line("world"));
        assert!(refused().contains("expected one file of this name"), "{}", refused());
    }

    #[test]
    fn classes_of_data_sets_are_ours_and_sorted() {
        let names = ["Pedestrian", "DontCare", "bus", "Van"];
        let mut frames = Frames::default();
        let labelled = names.map(|name| boxed(name, 0.0)).to_vec();
        frames.of = by_frame(0, Vec::new(), labelled, &mut frames.classes);
        frames.sort_classes();
        let classes = frames.of[0][1].iter().map(|one| one.class);
        assert_eq!(frames.classes, ["bus", "car", "person"]);
        assert_eq!(classes.collect::<Vec<_>>(), [Some(2), None, Some(0), Some(1)]);
    }
}
