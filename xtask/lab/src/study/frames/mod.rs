//! `cargo xtask bench frames`: what `edgepuck detect` finds in whole sweeps of real
//! sensors whose objects are labelled.

mod boxes;
mod precision;

use crate::table::{Table, percent, publish};
use anyhow::{Context, Result};
use boxes::BoxError;
use clap::Args;
use formats::interval::wilson;
use formats::labelled_sweep::{LabelledBox, read_labelled_sweep};
use glam::{DVec3, dvec3};
use infer_cpu::Options;
use infer_cpu::detect::{Detections, Detector, LEAST_CONFIDENCE, Label, Object, Sweep};
use precision::{OfClass, Place};
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub struct FramesArgs {
    /// Labelled sweeps as NPZ files with `xyz_mm`, `boxes` and `classes`. Those with `laser` are of
    /// Argoverse 2, in the car's frame, and labelled all round; others are of KITTI, in the
    /// sensor's frame, and labelled where its camera looks.
    #[arg(required = true, value_name = "FRAME")]
    frames: Vec<PathBuf>,
    /// Model for clusters: street-128, or the path of a model file.
    #[arg(long, default_value = "street-128", value_name = "MODEL")]
    model: PathBuf,
    /// Write the tables to this Markdown file.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// Fewest points of a cluster that is named, as `detect` has it.
const MIN_CLUSTER: usize = 20;
/// Objects of fewer points are not evaluated.
const MIN_POINTS: usize = 30;
/// Farther objects are not evaluated, metres.
const MAX_RANGE_M: f64 = 40.0;
/// KITTI's camera sees 1,242 pixels at a focal length of 721.5 pixels: 40.7 degrees to
/// either side of x.
const HALF_VIEW_RAD: f64 = 0.711;
/// Boxes are labelled by hand, and a sensor's noise reaches beyond them, metres.
const MARGIN_M: f64 = 0.3;
/// An object is found if a cluster holds this share of its points, and if this share of the
/// cluster's points are the object's.
const SHARE: f64 = 0.5;
/// Where the sensors of Argoverse 2's car stand, the mean of both, in the frame of the car, metres. Fitted so
/// that each laser draws a cone, to two sweeps of one log, which agree within a millimetre; other cars may differ.
const ARGOVERSE2_M: DVec3 = dvec3(1.347, 0.003, 1.583);
/// Borders of the bins of range, metres.
const RANGES_M: [f64; 5] = [0.0, 10.0, 20.0, 30.0, MAX_RANGE_M];

/// Least confidences of the curve.
const CONFIDENCES: [f64; 9] = [0.0, 0.3, 0.4, 0.5, 0.6, LEAST_CONFIDENCE, 0.8, 0.9, 0.95];

/// Labels of datasets, and the classes of a network for streets.
const CLASSES: [(&str, &str); 16] = [
    ("car", "car"),
    ("van", "car"),
    ("regular_vehicle", "car"),
    ("pedestrian", "person"),
    ("person_sitting", "person"),
    ("truck", "truck"),
    ("box_truck", "truck"),
    ("truck_cab", "truck"),
    ("large_vehicle", "truck"),
    ("bus", "bus"),
    ("school_bus", "bus"),
    ("cyclist", "two-wheeler"),
    ("bicyclist", "two-wheeler"),
    ("bicycle", "two-wheeler"),
    ("motorcycle", "two-wheeler"),
    ("motorcyclist", "two-wheeler"),
];

/// The class of a labelled object, if a network for streets has one for it.
fn class(label: &str) -> Option<&'static str> {
    let label = label.to_lowercase();
    CLASSES.iter().find(|(name, _)| *name == label).map(|(_, class)| *class)
}

/// The outcome of a labelled object that is found and named; others are a few words.
const NAMED: &str = "named";
/// No cluster holds most of it.
const NOT_CUT: &str = "not cut out";

struct Asked {
    frame: String,
    source: &'static str,
    class: &'static str,
    range_m: f64,
    n_points: usize,
    outcome: String,
    /// If it was named: of the box around its points, and of the whole.
    errors: Option<[BoxError; 2]>,
}

/// A named cluster without a label of its name.
struct FalseAlarm {
    frame: String,
    source: &'static str,
    class: String,
    truth: String,
    object: String,
}

/// A sweep, its labels in the sensor's frame, and the detections.
struct Judged {
    name: String,
    source: &'static str,
    points: Vec<[f64; 3]>,
    boxes: Vec<LabelledBox>,
    is_all_round: bool,
    found: Detections,
}

pub fn run(args: &FramesArgs) -> Result<()> {
    let mut detector = Detector::open(&args.model, &Options::default(), MIN_CLUSTER)?;
    detector.min_confidence = 0.0;
    let judged = args.frames.iter().map(|file| Judged::of(file, &mut detector));
    let mut judged = judged.collect::<Result<Vec<_>>>()?;
    let sources: Vec<_> = judged.iter().map(|frame| frame.source).collect();
    let precision = precision::table(&["car", "person"].map(|class| of_class(&judged, class)));
    let mut curve = Table::new(
        "By least confidence",
        &["least confidence", "found and named", "false cars and persons", "other false alarms"],
    );
    let mut tables = Vec::new();
    for confidence in CONFIDENCES {
        for frame in &mut judged {
            frame.found.objects.retain(|object| object.confidence >= confidence);
        }
        let asked: Vec<_> = judged.iter().flat_map(Judged::asked).collect();
        let alarms: Vec<_> = judged.iter().flat_map(Judged::false_alarms).collect();
        curve.push(point_of_curve(confidence, &asked, &alarms, &sources));
        if confidence == LEAST_CONFIDENCE {
            let boxes = boxes::table(&asked);
            let [misses, alarms_told] = [misses(&asked), alarm_table(&alarms)];
            tables = vec![summary(&asked, &sources), boxes, misses, alarms_told];
        }
    }
    tables.insert(2.min(tables.len()), precision);
    tables.insert(1.min(tables.len()), curve);
    publish(&tables, args.report.as_deref())
}

/// Where objects of a class are found, and where those are that have a point in the sweep.
fn of_class(judged: &[Judged], class_name: &'static str) -> OfClass {
    let mut of = OfClass { class: class_name, found: Vec::new(), labelled: Vec::new() };
    for (number, frame) in judged.iter().enumerate() {
        let place = |[x, y, _]: [f64; 3], score| {
            let centre_m = [x, y];
            frame.is_judged(centre_m).then_some(Place { frame: number, centre_m, score })
        };
        let found = frame.found.objects.iter().filter(|object| object.class == class_name);
        let found = found.map(|object| (object.whole.centre_m.map(f64::from), object.confidence));
        of.found.extend(found.filter_map(|(centre_m, score)| place(centre_m, score)));
        let is_seen = |one: &&LabelledBox| {
            class(&one.class) == Some(class_name) && !frame.points_in(one, 0.0).is_empty()
        };
        let labelled = frame.boxes.iter().filter(is_seen);
        of.labelled.extend(labelled.filter_map(|one| place(one.place.centre_m, 0.0)));
    }
    of
}

/// The names among `sources`, sorted.
fn distinct(sources: &[&'static str]) -> Vec<&'static str> {
    let mut names = sources.to_vec();
    names.sort_unstable();
    names.dedup();
    names
}

/// A row of the curve: what is found, and the false alarms a frame of each source.
fn point_of_curve(
    confidence: f64,
    asked: &[Asked],
    alarms: &[FalseAlarm],
    sources: &[&'static str],
) -> Vec<String> {
    let named = asked.iter().filter(|one| one.outcome == NAMED).count();
    let names = distinct(sources);
    let a_frame = |is_wanted: &dyn Fn(&str) -> bool| {
        let of = |name: &&str| {
            let of = alarms.iter().filter(|alarm| alarm.source == *name);
            let n = of.filter(|alarm| is_wanted(&alarm.class)).count();
            let n_frames = sources.iter().filter(|source| *source == name).count();
            format!("{:.2} ({name})", n as f64 / n_frames as f64)
        };
        names.iter().map(of).collect::<Vec<_>>().join(", ")
    };
    let is_asked = |class: &str| ["car", "person"].contains(&class);
    vec![
        format!("{confidence}"),
        format!("{named} of {}", asked.len()),
        a_frame(&is_asked),
        a_frame(&|class| !is_asked(class)),
    ]
}

impl Judged {
    fn of(file: &Path, detector: &mut Detector) -> Result<Self> {
        let mut sweep = read_labelled_sweep(file)?;
        let is_all_round = sweep.lasers.is_some();
        if is_all_round {
            let from_sensor = |at: [f64; 3]| (DVec3::from_array(at) - ARGOVERSE2_M).to_array();
            sweep.points.iter_mut().for_each(|point| *point = from_sensor(*point));
            sweep
                .boxes
                .iter_mut()
                .for_each(|one| one.place.centre_m = from_sensor(one.place.centre_m));
        }
        let points: Vec<_> = sweep.points.iter().map(|point| point.map(|x| x as f32)).collect();
        let rings = sweep.lasers.as_deref();
        let found = detector
            .detect(&Sweep { points: &points, rings })
            .with_context(|| file.display().to_string())?;
        Ok(Self {
            name: file.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            source: if is_all_round { "Argoverse 2, VLP-32C" } else { "KITTI, HDL-64E" },
            points: sweep.points,
            boxes: sweep.boxes,
            is_all_round,
            found,
        })
    }

    /// Whether objects at `centre_m` are labelled and near enough to be evaluated.
    fn is_judged(&self, [x, y]: [f64; 2]) -> bool {
        x.hypot(y) <= MAX_RANGE_M && (self.is_all_round || y.atan2(x).abs() <= HALF_VIEW_RAD)
    }

    fn asked(&self) -> Vec<Asked> {
        let mut asked = Vec::new();
        for one in &self.boxes {
            let [x, y, _] = one.place.centre_m;
            let class = class(&one.class).filter(|class| ["car", "person"].contains(class));
            let (Some(class), true) = (class, self.is_judged([x, y])) else { continue };
            let inside = self.points_in(one, 0.0);
            if inside.len() >= MIN_POINTS {
                let (outcome, object) = self.outcome(one, class, &inside);
                let of = |object: &Object| {
                    [object.place, object.whole]
                        .map(|place| BoxError::of(place.widened(), one.place))
                };
                let errors = object.map(of);
                let n_points = inside.len();
                let (frame, source) = (self.name.clone(), self.source);
                let range_m = x.hypot(y);
                asked.push(Asked { frame, source, class, range_m, n_points, outcome, errors });
            }
        }
        asked
    }

    fn points_in(&self, one: &LabelledBox, margin_m: f64) -> Vec<usize> {
        (0..self.points.len()).filter(|&i| one.place.contains(self.points[i], margin_m)).collect()
    }

    /// The outcome of the object in `one`, with the points `inside`, and what was found of it if that
    /// is named rightly.
    fn outcome(
        &self,
        one: &LabelledBox,
        class: &str,
        inside: &[usize],
    ) -> (String, Option<&Object>) {
        let labels = &self.found.labels;
        let standing: Vec<_> =
            inside.iter().map(|&i| labels[i]).filter(|label| *label != Label::Ground).collect();
        let mut clusters: Vec<u32> = standing
            .iter()
            .filter_map(
                |label| if let Label::Cluster(number) = label { Some(*number) } else { None },
            )
            .collect();
        clusters.sort_unstable();
        let largest = clusters.chunk_by(|a, b| a == b).max_by_key(|chunk| chunk.len());
        let Some(largest) = largest else { return (NOT_CUT.to_owned(), None) };
        let (within, all) = self.shared(largest[0], one);
        let holds = largest.len() as f64 >= SHARE * standing.len() as f64;
        if !holds || (within as f64) < SHARE * all as f64 {
            return (NOT_CUT.to_owned(), None);
        }
        match self.found.objects.iter().find(|object| object.cluster == largest[0]) {
            None => ("unknown".to_owned(), None),
            Some(object) if object.class == class => (NAMED.to_owned(), Some(object)),
            Some(object) => (format!("called {}", object.class), None),
        }
    }

    /// How many points of a cluster lie in `one`, and how many it has.
    fn shared(&self, cluster: u32, one: &LabelledBox) -> (usize, usize) {
        let labels = self.found.labels.iter().zip(&self.points);
        let members = labels.filter(|(label, _)| **label == Label::Cluster(cluster));
        members.fold((0, 0), |(within, all), (_, &point)| {
            (within + usize::from(one.place.contains(point, MARGIN_M)), all + 1)
        })
    }

    /// The named clusters of which no box of their class holds the larger part.
    fn false_alarms(&self) -> Vec<FalseAlarm> {
        let is_judged = |object: &&Object| {
            let [x, y, _] = object.place.centre_m.map(f64::from);
            self.is_judged([x, y])
        };
        let mut alarms = Vec::new();
        for object in self.found.objects.iter().filter(is_judged) {
            let holds = |one: &&LabelledBox| {
                let (within, all) = self.shared(object.cluster, one);
                within as f64 >= SHARE * all as f64
            };
            let held: Vec<_> = self.boxes.iter().filter(holds).collect();
            if held.iter().any(|one| class(&one.class) == Some(&object.class)) {
                continue;
            }
            let [x, y, z] = object.place.centre_m;
            let [length, width, height] = object.place.size_m;
            alarms.push(FalseAlarm {
                frame: self.name.clone(),
                source: self.source,
                class: object.class.clone(),
                truth: held.first().map_or("-".to_owned(), |one| one.class.clone()),
                object: format!(
                    "{} points at {x:.1} {y:.1} {z:.1}, {length:.1} x {width:.1} x {height:.1} m",
                    object.n_points
                ),
            });
        }
        alarms
    }
}

fn summary(asked: &[Asked], sources: &[&'static str]) -> Table {
    let mut table = Table::new(
        "Cars and persons of 30 points or more within 40 m",
        &["what", "found and named", "share", "95 % interval, %"],
    );
    let mut push = |name: String, of: &dyn Fn(&&Asked) -> bool| {
        let of: Vec<_> = asked.iter().filter(of).collect();
        let named = of.iter().filter(|one| one.outcome == NAMED).count();
        if of.is_empty() {
            return;
        }
        let (low, high) = wilson(named, of.len());
        let interval = format!("{} to {}", percent(low), percent(high));
        let share = percent(named as f64 / of.len() as f64);
        table.push(vec![name, format!("{named} of {}", of.len()), share, interval]);
    };
    push("all".to_owned(), &|_| true);
    for source in distinct(sources) {
        push(source.to_owned(), &|one| one.source == source);
        for class in ["car", "person"] {
            push(format!("{source}: {class}"), &|one| one.source == source && one.class == class);
        }
    }
    for range in RANGES_M.windows(2) {
        let within = |one: &&Asked| (range[0]..range[1]).contains(&one.range_m);
        push(format!("{} to {} m", range[0], range[1]), &within);
    }
    table
}

fn misses(asked: &[Asked]) -> Table {
    let missed: Vec<_> = asked.iter().filter(|one| one.outcome != NAMED).collect();
    Table::of(
        "What was missed",
        &missed,
        &[
            ("frame", &|one| one.frame.clone()),
            ("object", &|one| one.class.to_owned()),
            ("range, m", &|one| format!("{:.1}", one.range_m)),
            ("points", &|one| one.n_points.to_string()),
            ("outcome", &|one| one.outcome.clone()),
        ],
    )
}

fn alarm_table(alarms: &[FalseAlarm]) -> Table {
    Table::of(
        "False alarms",
        alarms,
        &[
            ("frame", &|one| one.frame.clone()),
            ("called", &|one| one.class.clone()),
            ("labelled", &|one| one.truth.clone()),
            ("what", &|one| one.object.clone()),
        ],
    )
}
