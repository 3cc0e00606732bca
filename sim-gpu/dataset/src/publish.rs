//! The card of a finished dataset for people, `README.md` with the front matter that Hugging Face
//! reads (<https://huggingface.co/docs/hub/datasets-cards>), and its metadata for programs,
//! `croissant.json` (Croissant 1.1 of MLCommons): both are templates that are filled.
//!
//! The metadata have the hash of the manifest alone, which leads to those of all files: they are as
//! short for a billion scans as for a hundred.

use crate::config::{DatasetConfig, SetConfig, Viewpoints};
use crate::error::DatasetError;
use crate::folder::{DatasetFolder, END_OF_CARD, PUBLISHED, read_json, write_json};
use crate::tars::{PartManifest, RootManifest, Sample, root_file};
use crate::verify::is_unfinished;
use formats::hash::Hashing;
use formats::scan::{ColumnSlot, Scan};
use formats::{Split, atomic, counted};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const CARD: &str = include_str!("publish/card.md");
/// `common`, and `distribution` and `recordSet` of each form of a dataset; a value `{key}` is filled.
const CROISSANT: &str = include_str!("publish/croissant.json");

/// The facts about a dataset that only its publisher knows.
#[derive(Clone, Debug, Default)]
pub struct Publication {
    /// Its name.
    pub name: String,
    /// Its licence, as an identifier of SPDX.
    pub license: Option<String>,
    /// Its address.
    pub url: Option<String>,
    /// Who made it.
    pub creator: Option<String>,
    /// The day of its publication, as `2026-11-25`.
    pub published: Option<String>,
}

/// What the manifest of a dataset says.
struct Facts {
    /// The version of Edgepuck that made it.
    version: String,
    config: DatasetConfig,
    /// A label is an index into them.
    classes: Vec<String>,
    /// The form of its files in the template of the metadata.
    form: &'static str,
    /// The number of clouds or scans.
    count: u64,
    /// The tars of each split, as `datasets` reads them.
    tars: Vec<Value>,
    /// The rows of the card's table of files.
    rows: Vec<String>,
    manifest: PathBuf,
}

/// Writes the card and the metadata of the finished dataset in `out`, and returns their paths.
///
/// # Errors
/// A dataset that is not finished, or is one part of several; a card or metadata that exist already,
/// unless `replace`; a file that cannot be read or written.
pub fn publish(
    out: &Path,
    publication: &Publication,
    replace: bool,
) -> Result<[PathBuf; 2], DatasetError> {
    if is_unfinished(out) {
        return Err(DatasetError::Unfinished { path: out.into() });
    }
    let is_tars = root_file(out).exists();
    let facts = if is_tars { Facts::from_tars(out) } else { Facts::from_files(out) }?;
    let files = PUBLISHED.map(|name| out.join(name));
    if let Some(path) = files.iter().find(|path| !replace && path.exists()) {
        let cause = "exists already; replace it with --overwrite";
        return Err(DatasetError::malformed(path, cause));
    }
    let values = values(publication, &facts)?;
    write_json(&files[1], &metadata(facts.form, &values))?;
    atomic::write_bytes(&files[0], card(&values))?;
    Ok(files)
}

impl Facts {
    fn from_tars(out: &Path) -> Result<Self, DatasetError> {
        let manifest = root_file(out);
        let RootManifest { version, config, cut, classes, parts, .. } = read_json(&manifest)?;
        let of_points = || format!(" of {}", counted(config.packed_points, "point"));
        let (form, noun, of) = match cut.sample {
            Sample::Clouds => ("clouds", "cloud", of_points()),
            Sample::Scan => ("scan", "scan", String::new()),
        };
        let mut all = Vec::new();
        for part in &parts {
            all.extend(read_json::<PartManifest>(&out.join(&part.file))?.tars);
        }
        let count = all.iter().map(|tar| tar.clouds).sum();
        let (mut rows, mut tars) = (Vec::new(), Vec::new());
        for split in Split::ALL {
            let own = all.iter().filter(|tar| tar.file.starts_with(split.name()));
            let (n, samples) = own.fold((0, 0), |(n, sum), tar| (n + 1, sum + tar.clouds));
            if n > 0 {
                let (n, samples) = (counted(n, "tar"), counted(samples, noun));
                rows.push(format!("| {n} `{split}-*.tar` | {samples}{of} |"));
                tars.push(json!({"split": split.name(), "path": format!("{split}-*.tar")}));
            }
        }
        Ok(Self { version, config, classes, form, count, tars, rows, manifest })
    }

    fn from_files(out: &Path) -> Result<Self, DatasetError> {
        let folder = DatasetFolder(out);
        let manifest = folder.manifest()?;
        if let Some((number, of)) = manifest.shard {
            let part = number + 1;
            let cause = format!("expected a whole dataset, found part {part} of {of}; merge them");
            return Err(DatasetError::malformed(out, cause));
        }
        let classes = manifest.classes();
        let scans = manifest.meshes.iter().flat_map(|mesh| &mesh.scans);
        let count = scans.map(|scan| scan.variants.len() as u64).sum();
        let (version, config) = (manifest.version, manifest.config);
        let packed = manifest.packed.iter().map(|it| {
            let points = counted(config.packed_points, "point");
            format!("| `{}` | {} of {points} |", it.file, counted(it.clouds, "cloud"))
        });
        let files = scan_patterns(&config).join("`, `");
        let scans = format!("| `{files}` | {}, in metres, z upwards |", counted(count, "scan"));
        let rows = packed.chain([scans]).collect();
        let (form, tars, manifest) = ("files", Vec::new(), folder.manifest_file());
        Ok(Self { version, config, classes, form, count, tars, rows, manifest })
    }
}

fn scan_patterns(config: &DatasetConfig) -> Vec<String> {
    let variants = || config.variants.iter();
    let of_set = |set: &SetConfig| {
        variants().map(|variant| format!("{}/{variant}/*.npz", set.name)).collect::<Vec<_>>()
    };
    config.sets.iter().flat_map(of_set).collect()
}

/// The values of both templates. A line of the card with a value that is null is left out.
fn values(publication: &Publication, facts: &Facts) -> Result<Value, DatasetError> {
    let Publication { name, license, url, creator, published } = publication;
    let hash = Hashing::Sha256.of_file(&facts.manifest)?;
    let manifest = facts.manifest.file_name().unwrap_or_default().to_string_lossy();
    let row = |(label, name)| json!({"classes/label": label, "classes/name": name});
    let known: Vec<&str> = [creator, published, url].into_iter().flatten().map(|s| &**s).collect();
    let named = facts.classes.iter().enumerate().map(|(label, name)| format!("{label} {name}"));
    let tars = json!([{"config_name": "default", "data_files": facts.tars}]).to_string();
    let sets = &facts.config.sets;
    let of: Vec<&str> = sets.iter().map(|set| set.sensor.name()).collect();
    let noun = if facts.form == "clouds" { "point cloud" } else { "scan" };
    let summary = format!(
        "{} of meshes of {}, simulated by Edgepuck {} for the sensor {}.",
        counted(facts.count, noun),
        counted(facts.classes.len(), "class"),
        facts.version,
        of.join(" and ")
    );
    Ok(json!({
        "{name}": name,
        // Every string of JSON is one of YAML.
        "{quoted}": json!(name).to_string(),
        "{spdx}": license.as_ref().map(|id| json!(id.to_lowercase()).to_string()),
        "{tars}": (facts.form != "files").then_some(tars),
        "{tag}": if facts.form == "files" { "" } else { ", webdataset" },
        "{rows}": facts.rows.join("\n"),
        "{named}": named.collect::<Vec<_>>().join(", "),
        "{sensors}": sets.iter().map(sensor).collect::<Vec<_>>().join("\n"),
        "{effects}": serde_json::to_string_pretty(&facts.config.effects).ok(),
        "{summary}": summary,
        "{license}": license.as_ref().map(|id| format!("https://spdx.org/licenses/{id}.html")),
        "{url}": url,
        "{published}": published,
        "{creator}": creator.as_ref().map(|name| json!({"@type": "sc:Person", "name": name})),
        "{cited}": creator.as_ref().map(|_| format!("{name}. {}", known.join(", "))),
        "{manifest}": manifest,
        "{sha256}": hash.map(|hash| hash.sha256),
        "{scans}": scan_patterns(&facts.config),
        "{shape}": format!("-1,{},3", facts.config.packed_points),
        "{columns}": columns(facts),
        "{classes}": facts.classes.iter().enumerate().map(row).collect::<Vec<_>>(),
    }))
}

fn card(values: &Value) -> String {
    let filled = CARD.split_inclusive('\n').filter_map(|line| {
        let (Some(from), Some(to)) = (line.find('{'), line.find('}')) else {
            return Some(line.to_owned());
        };
        match &values[&line[from..=to]] {
            Value::Null => None,
            value => Some(line.replace(&line[from..=to], value.as_str().unwrap_or_default())),
        }
    });
    filled.collect::<String>() + END_OF_CARD
}

fn sensor(set: &SetConfig) -> String {
    let between =
        |from: f64, to: Option<f64>| to.map_or(format!("{from}"), |to| format!("{from} to {to}"));
    let views = match &set.viewpoints {
        Viewpoints::Poses(poses) => counted(poses.len(), "given pose"),
        Viewpoints::Views(views) => format!(
            "{} of each mesh, at {} m and an elevation of {} degrees",
            counted(views.count, "view"),
            between(views.distance_m, views.distance_to_m),
            between(views.elevation_deg, views.elevation_to_deg),
        ),
    };
    format!("- `{}`: {} ({views}).", set.name, set.sensor.profile().description)
}

fn metadata(form: &str, values: &Value) -> Value {
    let values = values.as_object().into_iter().flatten();
    let filled = values.fold(CROISSANT.to_owned(), |text, (key, value)| {
        text.replace(&format!("\"{key}\""), &value.to_string())
    });
    let mut template: Value = serde_json::from_str(&filled).expect("invariant: it is JSON");
    let mut dataset = template["common"].take();
    for key in ["distribution", "recordSet"] {
        dataset[key] = template[form][key].take();
    }
    dataset.as_object_mut().expect("invariant: it is an object").retain(|_, it| !it.is_null());
    dataset
}

/// The arrays of a scan's NPZ file; -1 in a shape is the number of points.
fn columns(facts: &Facts) -> Vec<Value> {
    let files = if facts.form == "files" { "scan-files" } else { "sample-files" };
    let array = |name: &str, shape: &str| {
        json!({
            "@type": "cr:Field", "@id": format!("scan/{name}"), "name": name, "dataType": "sc:Float",
            "isArray": true, "arrayShape": shape,
            "source": {"fileSet": {"@id": files}, "extract": {"column": name}},
        })
    };
    let attribute = |attribute: &formats::Attribute| match Scan::default().slot(*attribute) {
        ColumnSlot::Vector(_) => array(attribute.name(), "-1,3"),
        _ => array(attribute.name(), "-1,1"),
    };
    let attributes = facts.config.attributes.iter().map(attribute);
    std::iter::once(array("positions", "-1,3")).chain(attributes).collect()
}
