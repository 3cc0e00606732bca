//! `edgepuck detect`: detects and classifies the objects of a sweep.

use std::path::{Path, PathBuf};
use std::time::Instant;

use formats::{atomic, counted};
use infer_cpu::detect::{
    DetectError, Detections, Detector, LEAST_CONFIDENCE, Object, OrientedBox, Sweep,
};
use infer_cpu::{Options, Precision};
use serde_json::{Value, json};

use crate::flags::probability;
use crate::kitti::{Camera, line};
use crate::points::SweepArgs;
use crate::segment;
use crate::{Outcome, Usage};
use program::outputs::{Overwrite, need_extension};

#[derive(clap::Args)]
pub(crate) struct DetectArgs {
    #[command(flatten)]
    input: SweepArgs,

    /// Bird's-eye model: street-bev, or the path of a model file
    #[arg(long, default_value = "street-bev", value_name = "MODEL")]
    model: PathBuf,

    /// File for the objects: .json, or .txt with a line of KITTI's labels for each. With
    /// --segment-only a folder
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

    /// Precision of the networks: f32 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,

    /// Only cut the sweep into ground and clusters, and classify none. The folder --out gets
    /// cluster-0000.npy and so on (the points of each cluster in metres from the sensor), sweep.ply
    /// (the sweep, coloured by cluster) and preview.png
    #[arg(long, conflicts_with_all = ["model", "calib", "min_points", "min_confidence", "precision"])]
    segment_only: bool,

    /// Clusters are connected points within this many metres, for clouds that are not sweeps of a
    /// sensor; these have no ground
    #[arg(long, value_name = "M", requires = "segment_only")]
    radius: Option<f32>,
}

pub(crate) fn run(args: &DetectArgs) -> anyhow::Result<Outcome> {
    if args.segment_only {
        return segment::run(&args.input, &args.out, &args.overwrite, args.radius);
    }
    need_extension("--out", &args.out, &["json", "txt"])?;
    let is_json = args.out.extension().is_some_and(|found| found.eq_ignore_ascii_case("json"));
    let cause = "--calib applies to KITTI's labels: expected --out with the extension .txt";
    anyhow::ensure!(!is_json || args.calib.is_none(), Usage(cause.to_owned()));
    args.overwrite.check([&*args.out])?;
    let camera = args.calib.as_deref().map(Camera::read).transpose()?;
    let scan = args.input.read_upright()?;
    let options = Options { precision: args.precision, ..Options::default() };
    let mut detector = open(&args.model, &options, args.min_points)?;
    detector.min_confidence = args.min_confidence;
    let started = Instant::now();
    let found = detector.detect(&Sweep { points: &scan.positions, rings: scan.ring.as_deref() })?;
    let Detections { objects, n_other, .. } = &found;
    let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();

    let written = if is_json {
        serde_json::to_vec_pretty(&json!({
            "frame": "the sensor's: metres, z up, the sensor at the origin",
            "sweep": args.input.sweep.file_name().unwrap_or_default().to_string_lossy(),
            "objects": objects.iter().map(json_of).collect::<Vec<_>>(),
        }))?
    } else {
        if camera.is_none() {
            program::say!(
                "the labels are in the sensor's frame: KITTI's tools expect those of --calib"
            );
        }
        let lines: String = objects.iter().map(|object| label(object, camera.as_ref())).collect();
        lines.into_bytes()
    };
    atomic::write_bytes(&args.out, written)?;
    program::say!(
        "{} in {elapsed_ms:.1} ms: {}, {}: {}",
        counted(scan.len(), "point"),
        counted(objects.len(), "object"),
        counted(*n_other, "other cluster"),
        args.out.display()
    );
    Ok(Outcome::Success)
}

fn open(model: &Path, options: &Options, min_points: usize) -> anyhow::Result<Detector> {
    Detector::open(model, options, min_points).map_err(|error| match error {
        DetectError::Settings(error) => anyhow::Error::new(Usage(error.to_string())),
        error => error.into(),
    })
}

fn json_of(object: &Object) -> Value {
    let of = |place: &OrientedBox<f32>| {
        let OrientedBox { centre_m, size_m, yaw_rad } = place;
        json!({ "centre_m": centre_m, "size_m": size_m, "yaw_deg": yaw_rad.to_degrees() })
    };
    let [x, y, _] = object.place.centre_m;
    json!({
        "class": object.class,
        "confidence": object.confidence,
        "points": object.n_points,
        "range_m": libm::hypotf(x, y),
        "box": of(&object.place),
        "whole_box": of(&object.whole),
    })
}

/// The line of an object in KITTI's labels of results, with its score.
fn label(object: &Object, camera: Option<&Camera>) -> String {
    let bounds = camera.and_then(|camera| camera.bounds(object.whole.widened().corners()));
    let about = line(&object.class, [-1.0, -1.0], bounds, object.whole, camera);
    format!("{about} {:.4}\n", object.confidence)
}
