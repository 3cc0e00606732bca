//! `edgepuck detect`: the named objects of a whole sweep.

use std::path::{Path, PathBuf};
use std::time::Instant;

use edgepuck_segment::{Label, OrientedBox, Segmenter, Settings, Sweep};
use formats::atomic;
use infer_cpu::{Classifier, Options, Precision};
use serde_json::{Value, json};

use crate::segment::{read_sweep, sensor_position, tint};
use crate::{Outcome, Usage, preview};

/// The model that comes with the program.
const BUNDLED: &str = "street-128";

/// Flags of `detect`.
#[derive(clap::Args)]
pub struct Args {
    /// Sweep, in any format that `segment` reads; metres, z up
    #[arg(value_name = "SWEEP")]
    sweep: PathBuf,

    /// Model for clusters: street-128, or the path of a model file
    #[arg(long, default_value = BUNDLED, value_name = "MODEL")]
    model: PathBuf,

    /// JSON file for the objects; a picture is written beside it, with the extension .png
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Where the sensor is in the sweep, in metres [default: 0 0 0]
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    sensor: Option<Vec<f64>>,

    /// Fewest points of an object
    #[arg(long, default_value_t = 20, value_name = "N")]
    min_points: usize,

    /// Precision of the network: f32, f32-fc16, f16 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,
}

/// Cuts the sweep and names its clusters.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let scan = read_sweep(&args.sweep, sensor_position(args.sensor.as_deref()))?;
    let options = Options { precision: args.precision, ..Options::default() };
    let mut classifier = open(&args.model, &options)?;
    let mut settings = Settings::default();
    settings.min_points = args.min_points;
    let mut segmenter = Segmenter::new(settings).map_err(|error| Usage(error.to_string()))?;
    let started = Instant::now();
    let sweep = Sweep { points: &scan.positions, rings: scan.ring.as_deref() };
    let segmentation = segmenter.segment(&sweep)?;

    let mut objects = Vec::new();
    let mut n_unknown = 0;
    let mut cloud = Vec::new();
    for (cluster, number) in segmentation.clusters().zip(0u32..) {
        cloud.clear();
        cloud.extend(cluster.points.iter().map(|&i| scan.positions[i as usize]));
        let prediction = classifier.classify_on_ground(&cloud, cluster.ground_z_m)?;
        if prediction.is_unknown {
            n_unknown += 1;
            continue;
        }
        let place = OrientedBox::around(&cloud);
        let name = (number, prediction.label.to_string(), place.centre_m);
        let object =
            object(prediction.label.as_ref(), prediction.confidence(), cloud.len(), &place);
        objects.push((name, object));
    }
    let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();

    let (names, objects): (Vec<_>, Vec<Value>) = objects.into_iter().unzip();
    eprintln!(
        "{} points in {elapsed_ms:.1} ms: {} objects, {n_unknown} unknown clusters: {}",
        scan.len(),
        objects.len(),
        args.out.display()
    );
    let written = json!({
        "frame": "the sensor's: metres, z up, the sensor at the origin",
        "sweep": args.sweep.file_name().unwrap_or_default().to_string_lossy(),
        "objects": objects,
    });
    atomic::write_bytes(&args.out, serde_json::to_vec_pretty(&written)?)?;
    let kept: Vec<u32> = names.iter().map(|(number, ..)| *number).collect();
    let texts: Vec<_> =
        names.iter().map(|(_, label, [x, y, _])| (label.as_str(), [*x, *y])).collect();
    let tints = segmentation.labels().iter().map(|&label| match label {
        Label::Cluster(number) if kept.binary_search(&number).is_err() => tint(Label::Small),
        other => tint(other),
    });
    let tints: Vec<_> = tints.collect();
    let title = args.sweep.file_stem().unwrap_or_default().to_string_lossy();
    let picture = args.out.with_extension("png");
    preview::draw_from_above(&scan, &tints, &texts, &title, &picture)?;
    Ok(Outcome::Success)
}

/// The bundled model, or else that of a file.
fn open(model: &Path, options: &Options) -> anyhow::Result<Classifier> {
    Ok(match model == Path::new(BUNDLED) {
        true => Classifier::from_bytes(edgepuck_assets::STREET_128, options)?,
        false => Classifier::load(model, options)?,
    })
}

fn object(class: &str, confidence: f64, n_points: usize, place: &OrientedBox) -> Value {
    let OrientedBox { centre_m, size_m, yaw_rad } = place;
    json!({
        "class": class,
        "confidence": confidence,
        "points": n_points,
        "range_m": centre_m[0].hypot(centre_m[1]),
        "box": { "centre_m": centre_m, "size_m": size_m, "yaw_deg": yaw_rad.to_degrees() },
    })
}
