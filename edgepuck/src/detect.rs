//! `edgepuck detect`: detects and classifies the objects of a sweep.

use std::path::{Path, PathBuf};
use std::time::Instant;

use edgepuck_segment::{Hierarchy, Label, Node, OrientedBox, Segmenter, Settings, Sweep};
use formats::{Scan, atomic};
use infer_cpu::rule::{MARGIN_OF_WHOLES, Rule};
use infer_cpu::{Classifier, ClassifierTeam, Options, Precision, Prediction, usual_size_m};
use serde_json::{Value, json};

use crate::flags::probability;
use crate::kitti::{Camera, corners, line};
use crate::points::SweepArgs;
use crate::preview::panel::Outline;
use crate::segment::tint;
use crate::{Outcome, Usage, colours, preview};
use formats::outputs::{Overwrite, need_extension};

/// The least confidence of an object, chosen by the false alarms on labelled sweeps
/// (assets/reports/reality/frames.md).
pub const LEAST_CONFIDENCE: f64 = 0.7;

#[derive(clap::Args)]
pub(crate) struct DetectArgs {
    #[command(flatten)]
    input: SweepArgs,

    /// Model for clusters: street-128, or the path of a model file
    #[arg(long, default_value = "street-128", value_name = "MODEL")]
    model: PathBuf,

    /// File for the objects: .json, or .txt with a line of KITTI's labels for each; a picture is
    /// written beside it, with the extension .png
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Calibration of KITTI's cameras (R0_rect, Tr_velo_to_cam and P2), by which labels are in the
    /// frame of the left colour camera, as KITTI's tools expect; without it, they are in the sensor's
    #[arg(long, value_name = "FILE")]
    calib: Option<PathBuf>,

    #[command(flatten)]
    overwrite: Overwrite,

    /// Fewest points of an object
    #[arg(long, default_value_t = 20, value_name = "N")]
    min_points: usize,

    /// Least confidence of an object, 0 to 1
    #[arg(long, default_value_t = LEAST_CONFIDENCE, value_name = "P", value_parser = probability)]
    min_confidence: f64,

    /// Precision of the network: f32, f32-fc16, f16 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,
}

pub(crate) fn run(args: &DetectArgs) -> anyhow::Result<Outcome> {
    need_extension("--out", &args.out, &["json", "txt"])?;
    let is_json = args.out.extension().is_some_and(|found| found.eq_ignore_ascii_case("json"));
    let cause = "--calib applies to KITTI's labels: expected --out with the extension .txt";
    anyhow::ensure!(!is_json || args.calib.is_none(), Usage(cause.to_owned()));
    let picture = args.out.with_extension("png");
    args.overwrite.check([&*args.out, &picture])?;
    let camera = args.calib.as_deref().map(Camera::read).transpose()?;
    let scan = args.input.read_upright()?;
    let options = Options { precision: args.precision, ..Options::default() };
    let mut detector = Detector::open(&args.model, &options, args.min_points)?;
    detector.min_confidence = args.min_confidence;
    let started = Instant::now();
    let found = detector.detect(&scan)?;
    let Detections { labels, objects, n_other } = &found;
    let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();

    let written = if is_json {
        serde_json::to_vec_pretty(&json!({
            "frame": "the sensor's: metres, z up, the sensor at the origin",
            "sweep": args.input.sweep.file_name().unwrap_or_default().to_string_lossy(),
            "objects": objects.iter().map(Object::json).collect::<Vec<_>>(),
        }))?
    } else {
        if camera.is_none() {
            formats::say!(
                "the labels are in the sensor's frame: KITTI's tools expect those of --calib"
            );
        }
        let lines: String = objects.iter().map(|object| label(object, camera.as_ref())).collect();
        lines.into_bytes()
    };
    atomic::write_bytes(&args.out, written)?;
    // Greys: clusters without an object are darker than all around them.
    let tints = labels.iter().map(|&label| match (found.object(label), label) {
        (Some(object), _) => colours::of_class(&objects[object].class),
        (None, Label::Cluster(_)) => tint(Label::Ground),
        (None, _) => tint(Label::Small),
    });
    let tints: Vec<_> = tints.collect();
    let outlines: Vec<_> = objects
        .iter()
        .map(|object| {
            let [a, b, c, d, ..] = corners(&object.whole);
            Outline {
                corners: [a, b, c, d].map(|corner| corner.truncate().to_array()),
                class: &object.class,
                score: Some(object.confidence),
                tint: colours::of_class(&object.class),
            }
        })
        .collect();
    preview::draw_from_above(&scan, &tints, &outlines, &args.input.title(), &picture)?;
    formats::say!(
        "{} points in {elapsed_ms:.1} ms: {} objects, {n_other} other clusters: {}",
        scan.len(),
        objects.len(),
        args.out.display()
    );
    Ok(Outcome::Success)
}

/// Detects and classifies objects in sweeps.
pub struct Detector {
    segmenter: Segmenter,
    /// Wider clusters are no object, metres.
    widest_m: f32,
    team: ClassifierTeam,
    rule: Rule,
    /// The least confidence of an object; clusters below count as unknown.
    pub min_confidence: f64,
}

/// The objects of a sweep.
pub struct Detections {
    /// The label of each point.
    pub labels: Vec<Label>,
    /// The clusters of known classes with enough confidence, in the order of their numbers.
    pub objects: Vec<Object>,
    /// The number of the other clusters: of unknown class, with too little confidence, or too wide.
    pub n_other: usize,
}

impl Detections {
    /// The index of the object whose points have this label.
    #[must_use]
    pub fn object(&self, label: Label) -> Option<usize> {
        let Label::Cluster(number) = label else { return None };
        self.objects.binary_search_by_key(&number, |object| object.cluster).ok()
    }
}

impl Detector {
    /// A detector with a bundled model or the one at a path, for clusters of at least
    /// `min_points` points.
    pub fn open(model: &Path, options: &Options, min_points: usize) -> anyhow::Result<Self> {
        let classifier = Classifier::load(model, options)?;
        if let Some(warning) = classifier.unsuited_to_clusters() {
            formats::say!("warning: {}: {warning}", model.display());
        }
        let mut settings = Settings::default();
        settings.min_points = min_points;
        let widest_m = settings.max_size_m;
        let segmenter = Segmenter::new(settings).map_err(|error| Usage(error.to_string()))?;
        let rule = Rule::new(&classifier);
        let team = ClassifierTeam::new(classifier)?;
        Ok(Self { segmenter, widest_m, team, rule, min_confidence: LEAST_CONFIDENCE })
    }

    /// Cuts `scan`, in the sensor's frame, into the clusters that are recognised best.
    pub fn detect(&mut self, scan: &Scan) -> anyhow::Result<Detections> {
        let Self { segmenter, widest_m, team, rule, min_confidence } = self;
        let sweep = Sweep { points: &scan.positions, rings: scan.ring.as_deref() };
        let hierarchy = segmenter.hierarchy(&sweep)?;
        let mut answers = answers(team, hierarchy, &scan.positions, *widest_m)?;
        let worth = |(node, answer): (Node<'_>, &Option<Prediction>)| {
            rule.worth(node.points.len(), answer.as_ref())
        };
        let worths: Vec<f64> = hierarchy.nodes().zip(&answers).map(worth).collect();
        let (nodes, cut) = segmenter.cut(&worths, MARGIN_OF_WHOLES);
        let mut found =
            Detections { labels: cut.labels().to_vec(), objects: Vec::new(), n_other: 0 };
        for ((cluster, &node), number) in cut.clusters().zip(nodes).zip(0..) {
            let is_object =
                |answer: &Prediction| !answer.is_unknown && answer.confidence() >= *min_confidence;
            match answers[node].take().filter(is_object) {
                None => found.n_other += 1,
                Some(answer) => {
                    let cloud = positions(&scan.positions, cluster.points);
                    found.objects.push(Object::new(number, &answer, &cloud, cluster.ground_z_m));
                }
            }
        }
        Ok(found)
    }
}

/// What the network answers to each node; `None` to those that are too wide for an object.
fn answers(
    team: &mut ClassifierTeam,
    hierarchy: &Hierarchy,
    points: &[[f32; 3]],
    widest_m: f32,
) -> anyhow::Result<Vec<Option<Prediction>>> {
    let is_asked = |node: &Node<'_>| node.diagonal_m <= widest_m;
    let asked = hierarchy.nodes().filter(is_asked);
    let clouds: Vec<_> =
        asked.map(|node| (positions(points, node.points), node.ground_z_m)).collect();
    let clouds = clouds.iter().map(|(cloud, ground_z_m)| (&cloud[..], *ground_z_m));
    let mut found = Vec::with_capacity(hierarchy.len());
    team.classify_many(clouds, |answer| found.push(answer.cloned().map_err(ToString::to_string)));
    let mut found = found.into_iter();
    let of = |node: Node<'_>| is_asked(&node).then(|| found.next()).flatten().transpose();
    hierarchy.nodes().map(of).collect::<Result<_, _>>().map_err(anyhow::Error::msg)
}

fn positions(points: &[[f32; 3]], of: &[u32]) -> Vec<[f32; 3]> {
    of.iter().map(|&i| points[i as usize]).collect()
}

/// A cluster of a known class.
pub struct Object {
    /// Its number among the clusters, as in [`Detections::labels`].
    pub cluster: u32,
    /// Its class.
    pub class: String,
    /// The confidence of the network in the class, 0 to 1.
    pub confidence: f64,
    /// The number of its points.
    pub n_points: usize,
    /// The box around its points.
    pub place: OrientedBox,
    /// The box of the whole object, by the usual size of its class; the same as `place` for other
    /// classes than those of streets.
    pub whole: OrientedBox,
}

impl Object {
    /// The object in the cluster `number`, of the points `cloud`, on ground of this height.
    fn new(number: u32, answer: &Prediction, cloud: &[[f32; 3]], ground_z_m: Option<f32>) -> Self {
        let (class, place) = (answer.label.to_string(), OrientedBox::around(cloud));
        Self {
            cluster: number,
            whole: usual_size_m(&class)
                .map_or(place, |usual_m| place.completed(usual_m, ground_z_m)),
            class,
            confidence: answer.confidence(),
            n_points: cloud.len(),
            place,
        }
    }

    fn json(&self) -> Value {
        let of = |place: &OrientedBox| {
            let OrientedBox { centre_m, size_m, yaw_rad } = place;
            json!({ "centre_m": centre_m, "size_m": size_m, "yaw_deg": yaw_rad.to_degrees() })
        };
        let [x, y, _] = self.place.centre_m;
        json!({
            "class": self.class,
            "confidence": self.confidence,
            "points": self.n_points,
            "range_m": libm::hypotf(x, y),
            "box": of(&self.place),
            "whole_box": of(&self.whole),
        })
    }
}

/// The line of an object in KITTI's labels of results, with its score.
fn label(object: &Object, camera: Option<&Camera>) -> String {
    let bounds = camera.and_then(|camera| camera.bounds(corners(&object.whole)));
    let about = line(&object.class, [-1.0, -1.0], bounds, &object.whole, camera);
    format!("{about} {:.4}\n", object.confidence)
}
