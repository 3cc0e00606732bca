//! The card of a dataset: Markdown, with the front matter that Hugging Face reads
//! (<https://huggingface.co/docs/hub/datasets-cards>).

use super::{Facts, Form, Publication};
use crate::config::{SetConfig, Viewpoints};
use crate::retract::CLOSE;
use crate::tars::Sample;
use formats::hash::Hashing;
use sim_gpu::internals::sensor::Views;
use std::fmt::Write;

/// The tags by which such datasets are found.
pub const TAGS: [&str; 4] = ["lidar", "point-cloud", "simulation", "synthetic"];

/// Hugging Face's size categories: the least number of samples, and the name.
const SIZES: [(u64, &str); 10] = [
    (1_000_000_000_000, "n>1T"),
    (100_000_000_000, "100B<n<1T"),
    (10_000_000_000, "10B<n<100B"),
    (1_000_000_000, "1B<n<10B"),
    (100_000_000, "100M<n<1B"),
    (10_000_000, "10M<n<100M"),
    (1_000_000, "1M<n<10M"),
    (100_000, "100K<n<1M"),
    (10_000, "10K<n<100K"),
    (1_000, "1K<n<10K"),
];

/// The category of smaller datasets.
const SMALLEST: &str = "n<1K";

pub fn card(publication: &Publication, facts: &Facts) -> String {
    let mut card = front_matter(publication, facts);
    let mut add = |text: &str| write!(card, "{text}\n\n").expect("invariant: a string takes all");
    add(&format!("# {}", publication.name));
    add(&summary(facts));
    add("## What it holds");
    add(&contents(facts));
    let classes = facts.classes.iter().enumerate();
    let classes: Vec<String> = classes.map(|(label, name)| format!("{label} {name}")).collect();
    add(&format!("Labels and classes: {}.", classes.join(", ")));
    add("## How it was made");
    let sensors: Vec<String> = facts.config.sets.iter().map(sensor).collect();
    add(&sensors.join("\n"));
    let effects = serde_json::to_string_pretty(&facts.config.effects)
        .expect("invariant: effects are read from such files");
    add(&format!("Effects, as a scene of Edgepuck has them:\n\n```json\n{effects}\n```"));
    let (manifest, _) = &facts.manifest;
    let hashes = match facts.config.hash {
        Hashing::None => "",
        Hashing::Sha256 | Hashing::Blake3 => " and leads to the hash of every file",
    };
    add(&format!(
        "`{manifest}` has the whole configuration{hashes}. With it, the \
         same version of Edgepuck ({}) makes the same bytes of the same meshes, on any number of \
         machines that have the same adapter. `edgepuck gen-dataset --verify FOLDER` checks the files.",
        facts.version
    ));
    add("## What it is for, and what it is not");
    card.push_str(
        "It trains and compares classifiers of LiDAR point clouds where real scans with labels are \
         missing. Each scan holds one object without a background. It is simulated: an accuracy on it \
         does not tell the accuracy on what a real sensor sees.\n\n",
    );
    card.push_str(CLOSE);
    card
}

/// The dataset in a sentence.
pub fn summary(facts: &Facts) -> String {
    let sensors: Vec<&str> = facts.config.sets.iter().map(|set| set.sensor.name()).collect();
    format!(
        "{} {} of meshes of {} classes, simulated by Edgepuck {} for the sensor {}.",
        facts.count(),
        facts.noun(),
        facts.classes.len(),
        facts.version,
        sensors.join(" and "),
    )
}

fn front_matter(publication: &Publication, facts: &Facts) -> String {
    let mut tags: Vec<&str> = TAGS.into();
    let mut lines = vec!["---".to_owned()];
    if let Some(license) = &publication.license {
        lines.push(format!("license: {}", quoted(&license.to_lowercase())));
    }
    lines.push(format!("pretty_name: {}", quoted(&publication.name)));
    lines.push("task_categories: [other]".to_owned());
    let size =
        SIZES.iter().find(|(least, _)| facts.count() >= *least).map_or(SMALLEST, |size| size.1);
    lines.push(format!("size_categories: [{}]", quoted(size)));
    if let Form::Tars { splits, .. } = &facts.form {
        tags.push("webdataset");
        lines.push("configs:\n  - config_name: default\n    data_files:".to_owned());
        for (split, _, _) in splits {
            lines.push(format!("      - {{split: {split}, path: \"{split}-*.tar\"}}"));
        }
    }
    lines.push(format!("tags: [{}]", tags.join(", ")));
    lines.push("---\n\n".to_owned());
    lines.join("\n")
}

/// A string of YAML: every string of JSON is one.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn contents(facts: &Facts) -> String {
    let points = facts.config.packed_points;
    match &facts.form {
        Form::Files { scans, packed } => {
            let mut table = "| file | what it holds |\n|---|---|".to_owned();
            for (file, clouds) in packed {
                let row = format!("\n| `{file}` | {clouds} clouds of {points} points |");
                table.push_str(&row);
            }
            let sets: Vec<String> =
                facts.config.sets.iter().map(|set| format!("`{}/`", set.name)).collect();
            let variants: Vec<String> =
                facts.config.variants.iter().map(|variant| format!("`{variant}`")).collect();
            format!(
                "{table}\n| {} | {scans} scans, in metres, z upwards: {}, then class and split |",
                sets.join(", "),
                variants.join(" or "),
            )
        }
        Form::Tars { cut, splits } => {
            let what = match cut.sample {
                Sample::Clouds => format!("clouds of {points} points"),
                Sample::Scan => "scans".to_owned(),
            };
            let mut table = "| files | what they hold |\n|---|---|".to_owned();
            for (split, tars, samples) in splits {
                let row = format!("\n| {tars} tars `{split}-*.tar` | {samples} {what} |");
                table.push_str(&row);
            }
            let samples = match cut.sample {
                Sample::Clouds => {
                    "Each sample is an NPZ file of clouds: `points`, f32 [m,n,3] in the unit sphere, and \
                     `labels`, i64 [m]."
                }
                Sample::Scan => {
                    "Each sample is a scan: `npz` has `positions`, f32 [n,3] in metres, and its other \
                     columns, `cls` the label, `json` the class, the mesh and the view."
                }
            };
            format!("{table}\n\n{samples} `webdataset` and `datasets` read them.")
        }
    }
}

fn sensor(set: &SetConfig) -> String {
    let views = match &set.viewpoints {
        Viewpoints::Poses(poses) => format!("{} given poses", poses.len()),
        Viewpoints::Views(views) => viewpoints(views),
    };
    format!("- `{}`: {} ({views}).", set.name, set.sensor.profile().description)
}

fn viewpoints(views: &Views) -> String {
    let between =
        |from: f64, to: Option<f64>| to.map_or(format!("{from}"), |to| format!("{from} to {to}"));
    format!(
        "{} {} each mesh, at {} m and an elevation of {} degrees",
        views.count,
        if views.count == 1 { "view of" } else { "views around" },
        between(views.distance_m, views.distance_to_m),
        between(views.elevation_deg, views.elevation_to_deg),
    )
}
