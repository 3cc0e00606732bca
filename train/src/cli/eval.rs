use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};

use crate::accuracy_report;
use crate::clouds::Clouds;
use crate::detections;
use crate::evaluate::evaluate;
use crate::object_report::{Labels, Table, classified};
use formats::atomic;
use formats::labelled::LabelledSet;
use formats::split::Split;
use infer_cpu::{Classifier, ModelCard, Options, Precision};
use program::outputs::{Overwrite, need_extension};

use super::Usage;

/// Flags of `eval`.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
For clouds of one size, `eval` prints the accuracy. For clusters whose file holds range_m,
sensor or ids, for several files, and with --known, --tracks or --min-points, it prints a
table: the shares of right answers, with 95 % intervals, by class, label, range, number of
points, sensor and file. An object whose label is not a class of the model is a negative;
the right answer to it is `unknown`. Views of one mesh are often right or wrong together: the
interval of an accuracy counts meshes, which the names of the clouds tell.

With --detections, it compares boxes with those of --truth: objects found and false alarms by class,
the average precision of the centres as nuScenes defines it, what was taken for what, and HOTA of tracks.
Both are files of detect, live, gen-scenes or gen-scenes --drive (its truth), of KITTI's labels, or JSON like
nuScenes' results; or folders of such files with the same names.")]
pub struct EvalArgs {
    /// The model file, or the name of a bundled model
    #[arg(long, value_name = "MODEL", required_unless_present = "detections")]
    model: Option<PathBuf>,
    /// Labelled clouds: a packed NPZ file, NPZ files of clusters (repeat the flag), or data with a
    /// test part in any form that `train --data` accepts
    #[arg(long, value_name = "PATH", required_unless_present = "detections")]
    data: Vec<PathBuf>,
    /// Boxes that a detector found, in place of a model
    #[arg(long, value_name = "PATH", requires = "truth")]
    #[arg(conflicts_with_all = ["model", "data", "precision", "known", "tracks", "csv"])]
    detections: Option<PathBuf>,
    /// Boxes of the objects that are there
    #[arg(long, value_name = "PATH", requires = "detections")]
    truth: Option<PathBuf>,
    /// Draw precision over recall of the detections to this file
    #[arg(long, value_name = "FILE", requires = "detections")]
    svg: Option<PathBuf>,
    /// Precision of the inference: f32 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,
    /// Write the confusion matrix, or the table for clusters, to this CSV file
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Known classes, separated by commas; any other answer counts as `unknown` [default: all
    /// classes that the model does not answer as `unknown`]
    #[arg(long, value_name = "CLASSES", value_delimiter = ',')]
    known: Vec<String>,
    /// Count all views of an object as one, by the track in the id, FRAME#TRACK
    #[arg(long)]
    tracks: bool,
    /// Leave out objects with fewer points
    #[arg(long, value_name = "N")]
    min_points: Option<usize>,
}

impl EvalArgs {
    fn model(&self) -> &Path {
        self.model.as_deref().expect("invariant: only with --detections there is none")
    }
}

pub fn run(args: &EvalArgs) -> anyhow::Result<()> {
    args.csv.iter().try_for_each(|file| need_extension("--csv", file, &["csv"]))?;
    args.svg.iter().try_for_each(|file| need_extension("--svg", file, &["svg"]))?;
    args.overwrite.check(args.csv.iter().chain(&args.svg).map(PathBuf::as_path))?;
    if let (Some(detections), Some(truth)) = (&args.detections, &args.truth) {
        return report_detections(args, [detections, truth]);
    }
    let full = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
    let data: Vec<PathBuf> = args.data.iter().map(full).collect();
    if let Some(i) = (0..data.len()).find(|&i| data[..i].contains(&data[i])) {
        let twice = args.data[i].display();
        return Err(Usage(format!("--data: expected each file once, found {twice} twice")).into());
    }
    let (card, names, unsuited) = {
        let classifier = Classifier::load(args.model(), &options(args))?;
        let names: Vec<String> = classifier.classes().iter().map(ToString::to_string).collect();
        (classifier.card().clone(), names, classifier.unsuited_to_clusters())
    };
    let read = |path| Clouds::read(card.normalization, path, Split::Test);
    let clouds = args.data.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
    let is_asked = !args.known.is_empty() || args.tracks || args.min_points.is_some();
    let has_remarks = |clouds: &Clouds| {
        let LabelledSet { range_m, sensor, ids, .. } = &clouds.set;
        range_m.is_some() || sensor.is_some() || ids.is_some()
    };
    if let Some(warning) = unsuited.filter(|_| clouds.iter().any(has_remarks)) {
        program::say!("warning: {}: {warning}", args.model().display());
    }
    match (&args.data[..], &clouds[..]) {
        ([data], [clouds]) if !is_asked && !has_remarks(clouds) => {
            report_clouds(args, data, clouds.clone(), &names)
        }
        _ => report_objects(args, &card, &names, &clouds),
    }
}

/// Reports on boxes that a detector found.
fn report_detections(args: &EvalArgs, files: [&Path; 2]) -> anyhow::Result<()> {
    let frames = detections::read(files)?;
    let least = args.min_points.unwrap_or(1) as u64;
    super::print(detections::table(&frames, least).trim_end())?;
    if let Some(path) = &args.svg {
        atomic::write_bytes(path, detections::to_svg(&frames, least))?;
        program::say!("precision over recall: {}", path.display());
    }
    Ok(())
}

fn options(args: &EvalArgs) -> Options {
    Options { precision: args.precision, ..Options::default() }
}

/// Reports on clouds whose classes are the model's.
fn report_clouds(
    args: &EvalArgs,
    data: &Path,
    mut clouds: Clouds,
    names: &[String],
) -> anyhow::Result<()> {
    let n_classes = clouds.classes.len();
    number_as_in_model(args, data, &mut clouds, names)?;
    let found = evaluate(args.model(), &clouds, &options(args))?;
    super::print(&accuracy_report::summary(&found, n_classes, data))?;
    if let Some(path) = &args.csv {
        atomic::write_bytes(path, accuracy_report::to_csv(&found, names))?;
        program::say!("confusion matrix: {}", path.display());
    }
    Ok(())
}

/// Gives `clouds` the model's classes, `names`, in the model's order. The data may have fewer classes,
/// for instance no `unknown`, and another order.
fn number_as_in_model(
    args: &EvalArgs,
    data: &Path,
    clouds: &mut Clouds,
    names: &[String],
) -> anyhow::Result<()> {
    let classes = std::mem::replace(&mut clouds.classes, names.to_vec());
    // The last classes of data without names may have no cloud.
    if Clouds::are_unnamed(&classes) && classes.len() <= names.len() {
        return Ok(());
    }
    for label in &mut clouds.set.labels {
        let class = &classes[*label];
        let Some(number) = names.iter().position(|name| name == class) else {
            bail!(
                "{}: expected classes of {}, found {class}: rename it in the file's `classes`, or give \
                 --min-points 1, which counts it as a negative",
                data.display(),
                args.model().display()
            );
        };
        *label = number;
    }
    Ok(())
}

/// Reports on objects that were cut out of scans.
fn report_objects(
    args: &EvalArgs,
    card: &ModelCard,
    names: &[String],
    clouds: &[Clouds],
) -> anyhow::Result<()> {
    let labels = Labels::new(names, &unknown(args, card, names)?);
    let least = args.min_points.unwrap_or(0);
    let mut objects = Vec::new();
    for (path, clouds) in args.data.iter().zip(clouds) {
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy();
        objects.extend(classified(args.model(), &name, clouds, (&labels, least), &options(args))?);
    }
    ensure!(!objects.is_empty(), "expected objects, found none of --min-points {least} or more");
    let table = Table::new(&objects, &labels, args.tracks);
    let balanced = 100.0 * table.balanced();
    super::print(&format!("{table}\nmean over classes and negatives: {balanced:.1} %"))?;
    let mut lacking: BTreeMap<&str, usize> = BTreeMap::new();
    for object in objects.iter().filter(|object| labels.class(&object.label).is_none()) {
        *lacking.entry(&object.label).or_default() += 1;
    }
    let lacking: Vec<_> = lacking.iter().map(|(label, n)| format!("{label} ({n})")).collect();
    if !lacking.is_empty() {
        let lacking = lacking.join(", ");
        super::print(&format!("negatives that the model has no class for: {lacking}"))?;
    }
    if let Some(path) = &args.csv {
        atomic::write_bytes(path, table.to_csv())?;
        program::say!("table: {}", path.display());
    }
    Ok(())
}

/// The classes of the model, among all its `names`, that count as `unknown`.
fn unknown(args: &EvalArgs, card: &ModelCard, names: &[String]) -> Result<Vec<String>, Usage> {
    let known = &args.known;
    if known.is_empty() {
        return Ok(card.unknown_classes.clone());
    }
    if let Some(name) = known.iter().find(|name| !names.contains(name)) {
        let names = names.join(", ");
        return Err(Usage(format!("--known: expected some of {names}, found {name}")));
    }
    Ok(names.iter().filter(|class| !known.contains(class)).cloned().collect())
}
