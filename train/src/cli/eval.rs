use std::collections::BTreeMap;
use std::iter::repeat_n;
use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};

use crate::accuracy_report;
use crate::clouds::Clouds;
use crate::evaluate::confusion;
use crate::object_report::{self, Labels, Object, Table, Truth, classified};
use crate::run::MOST_POINTS;
use formats::atomic;
use formats::labelled::LabelledSet;
use formats::outputs::{Overwrite, need_extension};
use formats::split::Split;
use infer_cpu::{Classifier, ModelCard, Options, Precision};

use super::Usage;

/// Flags of `eval`.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
For clouds of one size, `eval` prints the accuracy. For clusters whose file holds range_m,
sensor or ids, for several files, and with --known, --map, --tracks or --min-points, it
prints a table: the shares of right answers, with 95 % intervals, by class, label, range,
number of points, sensor and file. An object whose label is not a class of the model is a
negative; the right answer to it is `unknown`.")]
pub struct EvalArgs {
    /// The model file, or the name of a bundled model
    #[arg(long, value_name = "MODEL")]
    model: PathBuf,
    /// Labelled clouds: a packed NPZ file, NPZ files of clusters (repeat the flag), or data with a
    /// test part in any form that `train --data` accepts
    #[arg(long, value_name = "PATH", required = true)]
    data: Vec<PathBuf>,
    /// Precision of the inference: f32, f32-fc16, f16 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,
    /// Whether outliers are dropped before sampling, from clouds in the unit sphere [default: as in
    /// training]
    #[arg(long, value_name = "YES")]
    outlier_filter: Option<bool>,
    /// Write the confusion matrix, or the table for clusters, to this CSV file
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw the confusion matrix, or the clusters that are named wrongly, into this SVG file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    objects: ObjectArgs,
}

/// Flags of `eval` for clusters.
#[derive(clap::Args, Debug)]
struct ObjectArgs {
    /// Known classes, separated by commas; any other answer counts as `unknown` [default: all
    /// classes that the model does not answer as `unknown`]
    #[arg(long, value_name = "CLASSES", value_delimiter = ',')]
    known: Vec<String>,
    /// TOML file that maps labels of the data to classes of the model, such as `pedestrian =
    /// "person"`; `rider = ""` leaves such objects out
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Count all views of an object as one, by the track in the id, FRAME#TRACK
    #[arg(long)]
    tracks: bool,
    /// Leave out objects with fewer points
    #[arg(long, value_name = "N")]
    min_points: Option<usize>,
}

pub fn run(args: &EvalArgs) -> anyhow::Result<()> {
    for (flag, file, extension) in [("--csv", &args.csv, "csv"), ("--svg", &args.svg, "svg")] {
        file.iter().try_for_each(|file| need_extension(flag, file, &[extension]))?;
    }
    args.overwrite.check(args.csv.iter().chain(&args.svg).map(PathBuf::as_path))?;
    let full = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
    let data: Vec<PathBuf> = args.data.iter().map(full).collect();
    if let Some(i) = (0..data.len()).find(|&i| data[..i].contains(&data[i])) {
        let twice = args.data[i].display();
        return Err(Usage(format!("--data: expected each file once, found {twice} twice")).into());
    }
    let (card, names, unsuited) = {
        let classifier = Classifier::load(&args.model, &options(args))?;
        let names: Vec<String> = classifier.classes().iter().map(ToString::to_string).collect();
        (classifier.card().clone(), names, classifier.unsuited_to_clusters())
    };
    let read = |path| Clouds::read_for(card.normalization, path, Split::Test, MOST_POINTS);
    let clouds = args.data.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
    let ObjectArgs { known, map, tracks, min_points } = &args.objects;
    let is_asked = !known.is_empty() || map.is_some() || *tracks || min_points.is_some();
    let has_remarks = |clouds: &Clouds| {
        let LabelledSet { range_m, sensor, ids, .. } = &clouds.set;
        range_m.is_some() || sensor.is_some() || ids.is_some()
    };
    if let Some(warning) = unsuited.filter(|_| clouds.iter().any(has_remarks)) {
        formats::say!("warning: {}: {warning}", args.model.display());
    }
    match (&args.data[..], &clouds[..]) {
        ([data], [clouds]) if !is_asked && !has_remarks(clouds) => {
            report_clouds(args, data, clouds, &names)
        }
        _ => report_objects(args, &card, &names, clouds),
    }
}

fn options(args: &EvalArgs) -> Options {
    let EvalArgs { precision, outlier_filter, .. } = *args;
    Options { precision, outlier_filter, ..Options::default() }
}

/// Reports on clouds whose classes are the model's.
fn report_clouds(
    args: &EvalArgs,
    data: &Path,
    clouds: &Clouds,
    names: &[String],
) -> anyhow::Result<()> {
    let n_classes = clouds.classes.len();
    let clouds = numbered_as_in_model(args, data, clouds.clone(), names)?;
    let found = confusion(&args.model, &clouds, &options(args))?;
    let mut pairs = names.iter().zip(&clouds.classes).enumerate();
    if let Some((class, (model, data))) = pairs.find(|(_, (model, data))| model != data) {
        formats::say!(
            "warning: class {class} is called `{model}` by the model and `{data}` by the data"
        );
    }
    super::print(&accuracy_report::summary(&found, n_classes, data))?;
    if let Some(path) = &args.csv {
        atomic::write_bytes(path, accuracy_report::to_csv(&found, names))?;
    }
    if let Some(path) = &args.svg {
        atomic::write_bytes(path, accuracy_report::drawing(&found, names))?;
    }
    Ok(())
}

/// `clouds` with the model's classes, `names`, in the model's order. The data may have fewer classes, for
/// instance no `unknown`, and another order. As many other classes stay as they are.
fn numbered_as_in_model(
    args: &EvalArgs,
    data: &Path,
    mut clouds: Clouds,
    names: &[String],
) -> anyhow::Result<Clouds> {
    let n_classes = clouds.classes.len();
    let by_name = |class: &String| names.iter().position(|name| name == class);
    let numbers: Vec<Option<usize>> = clouds.classes.iter().map(by_name).collect();
    match clouds.set.labels.iter().find(|label| numbers[**label].is_none()) {
        None => {
            for label in &mut clouds.set.labels {
                *label = numbers[*label].expect("invariant: the model has every label");
            }
        }
        // The last classes may have no cloud.
        Some(_) if clouds.is_unnamed() && n_classes <= names.len() => {}
        Some(_) if n_classes == names.len() => return Ok(clouds),
        Some(&strange) => {
            let class = &clouds.classes[strange];
            bail!(
                "{}: expected classes of {}, found {class}: in a file for --map, `{class} = \
                 \"unknown\"` counts it as unknown, and a class of the model in place of `unknown` \
                 renames it",
                data.display(),
                args.model.display()
            );
        }
    }
    clouds.classes = names.to_vec();
    Ok(clouds)
}

/// Reports on objects that were cut out of scans.
fn report_objects(
    args: &EvalArgs,
    card: &ModelCard,
    names: &[String],
    clouds: Vec<Clouds>,
) -> anyhow::Result<()> {
    let mut labels = Labels::new(names, &unknown(args, card, names)?);
    if let Some(path) = &args.objects.map {
        let of_data = clouds.iter().flat_map(|clouds| &clouds.classes).map(String::as_str);
        labels = labels.with_aliases(path, &of_data.collect())?;
    }
    let least = args.objects.min_points.unwrap_or(0);
    let (mut objects, mut sets) = (Vec::new(), Vec::new());
    for (path, clouds) in args.data.iter().zip(clouds) {
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy();
        let found = classified(&args.model, &name, &clouds, (&labels, least), &options(args))?;
        sets.push((clouds.set, found.len()));
        objects.extend(found);
    }
    ensure!(
        !objects.is_empty(),
        "expected objects, found none that --min-points and --map leave in the data"
    );
    let table = Table::new(&objects, &labels, args.objects.tracks);
    super::print(&format!("{table}\n{}", summary(&objects, &labels, &table)))?;
    if let Some(path) = &args.csv {
        atomic::write_bytes(path, table.to_csv())?;
    }
    if let Some(path) = &args.svg {
        let each_set = sets.iter().flat_map(|(set, n)| repeat_n(set, *n));
        let clouds: Vec<_> =
            each_set.zip(&objects).map(|(set, object)| set.cloud(object.index)).collect();
        let drawing = object_report::drawing(&objects, &clouds, &labels);
        atomic::write_bytes(path, drawing)?;
    }
    Ok(())
}

/// The classes of the model, among all its `names`, that count as `unknown`.
fn unknown(args: &EvalArgs, card: &ModelCard, names: &[String]) -> Result<Vec<String>, Usage> {
    let known = &args.objects.known;
    if known.is_empty() {
        return Ok(card.unknown_classes.clone());
    }
    if let Some(name) = known.iter().find(|name| !names.contains(name)) {
        let names = names.join(", ");
        return Err(Usage(format!("--known: expected some of {names}, found {name}")));
    }
    Ok(names.iter().filter(|class| !known.contains(class)).cloned().collect())
}

fn summary(objects: &[Object], labels: &Labels, table: &Table) -> String {
    let mut lines = Vec::new();
    if let Some(balanced) = table.balanced() {
        lines.push(format!("mean over classes and negatives: {:.1} %", 100.0 * balanced));
    }
    type Score = fn(&Object) -> Option<f64>;
    let scores = |is_known: bool, score: Score| -> Vec<f64> {
        let some = objects.iter().filter(|o| (o.truth != Truth::Negative) == is_known);
        some.filter_map(score).collect()
    };
    let kinds: [(_, Score); 2] =
        [("margin", |o| o.answer.margin), ("energy", |o| Some(o.answer.energy))];
    for (name, score) in kinds {
        let found = object_report::detection(&scores(true, score), &scores(false, score));
        if let Some(found) = found {
            let object_report::Detection { auroc, fpr_at_95 } = found;
            lines.push(format!(
                "negatives separated by {name}: AUROC {auroc:.3}, false alarms {:.1} % where 95 % of \
                 known objects stay known",
                100.0 * fpr_at_95
            ));
        }
    }
    let confidences = objects.iter().filter_map(|object| match object.truth {
        Truth::Known(class) => Some((object.answer.confidence, object.answer.fine == class)),
        Truth::Negative => None,
    });
    let error = object_report::calibration_error(&confidences.collect::<Vec<_>>());
    lines.push(format!("calibration error of known objects: {:.1} %", 100.0 * error));
    let mut lacking: BTreeMap<&str, usize> = BTreeMap::new();
    for object in objects.iter().filter(|object| labels.lacks(&object.label)) {
        *lacking.entry(&object.label).or_default() += 1;
    }
    if !lacking.is_empty() {
        let lacking: Vec<String> =
            lacking.iter().map(|(label, n)| format!("{label} ({n})")).collect();
        lines.push(format!("negatives that the model has no class for: {}", lacking.join(", ")));
    }
    lines.join("\n")
}
