//! `edgepuck detect`: detects and classifies the objects of a sweep.

use std::path::{Path, PathBuf};
use std::time::Instant;

use edgepuck_segment::{Label, OrientedBox, Segmenter, Settings, Sweep};
use formats::{Scan, atomic};
use infer_cpu::{Classifier, Options, Precision};
use serde_json::{Value, json};

use crate::flags::need_extension;
use crate::overwrite::Overwrite;
use crate::points::SweepArgs;
use crate::segment::tint;
use crate::{Outcome, Usage, preview};

#[derive(clap::Args)]
pub(crate) struct DetectArgs {
    #[command(flatten)]
    input: SweepArgs,

    /// Model for clusters: street-128, or the path of a model file
    #[arg(long, default_value = "street-128", value_name = "MODEL")]
    model: PathBuf,

    /// JSON file (.json) for the objects; a picture is written beside it, with the extension .png
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    overwrite: Overwrite,

    /// Fewest points of an object
    #[arg(long, default_value_t = 20, value_name = "N")]
    min_points: usize,

    /// Precision of the network: f32, f32-fc16, f16 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,
}

pub(crate) fn run(args: &DetectArgs) -> anyhow::Result<Outcome> {
    need_extension("--out", &args.out, "json")?;
    let picture = args.out.with_extension("png");
    args.overwrite.check([&*args.out, &picture])?;
    let scan = args.input.read()?;
    let options = Options { precision: args.precision, ..Options::default() };
    let mut detector = Detector::open(&args.model, &options, args.min_points)?;
    let started = Instant::now();
    let Detections { labels, objects, n_unknown } = detector.detect(&scan)?;
    let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();

    eprintln!(
        "{} points in {elapsed_ms:.1} ms: {} objects, {n_unknown} unknown clusters: {}",
        scan.len(),
        objects.len(),
        args.out.display()
    );
    let written = json!({
        "frame": "the sensor's: metres, z up, the sensor at the origin",
        "sweep": args.input.sweep.file_name().unwrap_or_default().to_string_lossy(),
        "objects": objects.iter().map(Object::json).collect::<Vec<_>>(),
    });
    atomic::write_bytes(&args.out, serde_json::to_vec_pretty(&written)?)?;
    let is_named = |number| objects.binary_search_by_key(&number, |object| object.cluster).is_ok();
    let tints = labels.iter().map(|&label| match label {
        Label::Cluster(number) if !is_named(number) => tint(Label::Small),
        other => tint(other),
    });
    let tints: Vec<_> = tints.collect();
    let names: Vec<_> = objects.iter().map(Object::name).collect();
    preview::draw_from_above(&scan, &tints, &names, &args.input.title(), &picture)?;
    Ok(Outcome::Success)
}

/// Detects and classifies objects in sweeps.
pub struct Detector {
    segmenter: Segmenter,
    classifier: Classifier,
}

/// The objects of a sweep.
pub struct Detections {
    /// The label of each point.
    pub labels: Vec<Label>,
    /// The clusters of known classes, in the order of their numbers.
    pub objects: Vec<Object>,
    /// The number of clusters of unknown class.
    pub n_unknown: usize,
}

impl Detector {
    /// A detector with a bundled model or the one at a path, for clusters of at least
    /// `min_points` points.
    pub fn open(model: &Path, options: &Options, min_points: usize) -> anyhow::Result<Self> {
        let classifier = Classifier::load(model, options)?;
        if let Some(warning) = classifier.unsuited_to_clusters() {
            eprintln!("warning: {}: {warning}", model.display());
        }
        let mut settings = Settings::default();
        settings.min_points = min_points;
        let segmenter = Segmenter::new(settings).map_err(|error| Usage(error.to_string()))?;
        Ok(Self { segmenter, classifier })
    }

    /// Segments `scan`, in the sensor's frame, and classifies its clusters.
    pub fn detect(&mut self, scan: &Scan) -> anyhow::Result<Detections> {
        let sweep = Sweep { points: &scan.positions, rings: scan.ring.as_deref() };
        let segmentation = self.segmenter.segment(&sweep)?;
        let labels = segmentation.labels().to_vec();
        let mut found = Detections { labels, objects: Vec::new(), n_unknown: 0 };
        let mut cloud = Vec::new();
        for (cluster, number) in segmentation.clusters().zip(0..) {
            cloud.clear();
            cloud.extend(cluster.points.iter().map(|&i| scan.positions[i as usize]));
            let prediction = self.classifier.classify_on_ground(&cloud, cluster.ground_z_m)?;
            if prediction.is_unknown {
                found.n_unknown += 1;
                continue;
            }
            found.objects.push(Object {
                cluster: number,
                class: prediction.label.to_string(),
                confidence: prediction.confidence(),
                n_points: cloud.len(),
                place: OrientedBox::around(&cloud),
            });
        }
        Ok(found)
    }
}

/// A cluster of a known class.
pub struct Object {
    /// Its number among the clusters.
    pub cluster: u32,
    /// Its class.
    pub class: String,
    /// The confidence of the network in the class, 0 to 1.
    pub confidence: f64,
    /// The number of its points.
    pub n_points: usize,
    /// The box around it.
    pub place: OrientedBox,
}

impl Object {
    /// Its class, and its position seen from above.
    fn name(&self) -> (&str, [f32; 2]) {
        let [x, y, _] = self.place.centre_m;
        (&self.class, [x, y])
    }

    fn json(&self) -> Value {
        let OrientedBox { centre_m, size_m, yaw_rad } = self.place;
        json!({
            "class": self.class,
            "confidence": self.confidence,
            "points": self.n_points,
            "range_m": centre_m[0].hypot(centre_m[1]),
            "box": { "centre_m": centre_m, "size_m": size_m, "yaw_deg": yaw_rad.to_degrees() },
        })
    }
}
