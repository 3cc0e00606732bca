//! The metadata of a dataset in Croissant 1.1 (MLCommons, <https://docs.mlcommons.org/croissant/docs/croissant-spec-1.1.html>).
//!
//! The metadata have only the hash of the manifest, which lists the hashes of all files. The metadata
//! of a billion scans are therefore as short as those of a hundred. mlcroissant reads the classes and
//! the list of files. It does not open NPZ files: their arrays are described for people and for search.

use super::{Facts, Form, Publication};
use crate::config::Variant;
use crate::tars::Sample;
use formats::scan::{ColumnSlot, Scan};
use serde_json::{Map, Value, json};

/// The vocabulary of Croissant that is used here, as its specification maps it.
const CONTEXT: &str = include_str!("context.json");

pub fn metadata(publication: &Publication, facts: &Facts) -> Value {
    let context: Value = serde_json::from_str(CONTEXT).expect("invariant: the context is JSON");
    let (manifest, sha256) = &facts.manifest;
    let mut files = vec![json!({
        "@type": "cr:FileObject", "@id": manifest, "name": manifest, "contentUrl": manifest,
        "encodingFormat": "application/json", "sha256": sha256,
    })];
    let mut records = vec![classes(&facts.classes)];
    match &facts.form {
        Form::Files { .. } => {
            files.push(file_set("scan-files", "application/x-npz", scan_patterns(facts), None));
            files.push(file_set(
                "packed-files",
                "application/x-npz",
                vec!["packed/*.npz".into()],
                None,
            ));
            let lists = json!({"fileObject": {"@id": manifest}});
            records.push(listed(&lists, "packed", &["file", "clouds"]));
            records.push(scans("scan-files", facts));
            records.push(clouds("packed-files", facts));
        }
        Form::Tars { cut, .. } => {
            let all = |pattern: &str| vec![pattern.to_owned()];
            files.push(file_set("part-manifests", "application/json", all("part-*.json"), None));
            files.push(file_set("tar-files", "application/x-tar", all("*.tar"), None));
            files.push(file_set(
                "sample-files",
                "application/x-npz",
                all("*.npz"),
                Some("tar-files"),
            ));
            let lists = json!({"fileSet": {"@id": "part-manifests"}});
            records.push(listed(&lists, "tars", &["file", "clouds", "bytes"]));
            if cut.sample == Sample::Scan {
                files.push(file_set("label-files", "text/plain", all("*.cls"), Some("tar-files")));
                records.push(labels());
            }
            records.push(match cut.sample {
                Sample::Clouds => clouds("sample-files", facts),
                Sample::Scan => scans("sample-files", facts),
            });
        }
    }
    let mut dataset = json!({
        "@context": context,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        "name": publication.name,
        "description": super::card::summary(facts),
        "keywords": super::card::TAGS,
        "version": "1.0.0",
        "distribution": files,
        "recordSet": records,
    });
    let known = dataset.as_object_mut().expect("invariant: it is an object");
    add_publication(known, publication);
    dataset
}

fn add_publication(dataset: &mut Map<String, Value>, publication: &Publication) {
    let Publication { license, url, creator, published, .. } = publication;
    let license = license.as_ref().map(|id| format!("https://spdx.org/licenses/{id}.html"));
    let texts = [("license", &license), ("url", url), ("datePublished", published)];
    for (key, text) in texts {
        if let Some(text) = text {
            dataset.insert(key.to_owned(), json!(text));
        }
    }
    if let Some(name) = creator {
        let known = [Some(name), published.as_ref(), url.as_ref()].into_iter().flatten();
        let known: Vec<&str> = known.map(String::as_str).collect();
        let cited = format!("{}. {}", publication.name, known.join(", "));
        dataset.insert("citeAs".to_owned(), json!(cited));
        dataset.insert("creator".to_owned(), json!({"@type": "sc:Person", "name": name}));
    }
}

/// The files whose names match one of `patterns`: in the dataset's folder, or in the archives of the
/// file set `within`.
fn file_set(id: &str, format: &str, patterns: Vec<String>, within: Option<&str>) -> Value {
    let mut set = json!({
        "@type": "cr:FileSet", "@id": id, "name": id, "encodingFormat": format,
        "includes": patterns,
    });
    if let Some(within) = within {
        set["containedIn"] = json!({"@id": within});
    }
    set
}

fn scan_patterns(facts: &Facts) -> Vec<String> {
    let variants = |set: &str| {
        let pattern = |variant: &Variant| format!("{set}/{variant}/*.npz");
        facts.config.variants.iter().map(pattern).collect::<Vec<_>>()
    };
    facts.config.sets.iter().flat_map(|set| variants(&set.name)).collect()
}

fn record_set(id: &str, fields: Vec<Value>) -> Value {
    json!({"@type": "cr:RecordSet", "@id": id, "name": id, "field": fields})
}

fn field(set: &str, name: &str, data_type: &str) -> Value {
    let id = format!("{set}/{name}");
    json!({"@type": "cr:Field", "@id": id, "name": name, "dataType": data_type})
}

/// The array `name` of the NPZ files of `file_set`; -1 in its shape is a size that differs by file.
fn array(set: &str, name: &str, file_set: &str, shape: &str) -> Value {
    let data_type = if name == "labels" { "sc:Integer" } else { "sc:Float" };
    let mut array = field(set, name, data_type);
    array["isArray"] = json!(true);
    array["arrayShape"] = json!(shape);
    array["source"] = json!({"fileSet": {"@id": file_set}, "extract": {"column": name}});
    array
}

fn classes(names: &[String]) -> Value {
    let fields = vec![field("classes", "label", "sc:Integer"), field("classes", "name", "sc:Text")];
    let row = |(label, name)| json!({"classes/label": label, "classes/name": name});
    let mut set = record_set("classes", fields);
    set["dataType"] = json!("sc:Enumeration");
    set["key"] = json!({"@id": "classes/label"});
    set["data"] = names.iter().enumerate().map(row).collect();
    set
}

/// The list `list` in the JSON files of `source`: the values of `keys` of each entry.
fn listed(source: &Value, list: &str, keys: &[&str]) -> Value {
    let column = |key: &&str| {
        let data_type = if *key == "file" { "sc:Text" } else { "sc:Integer" };
        let mut one = field(list, key, data_type);
        one["source"] = source.clone();
        one["source"]["extract"] = json!({"jsonPath": format!("$.{list}[*].{key}")});
        one
    };
    record_set(list, keys.iter().map(column).collect())
}

fn clouds(file_set: &str, facts: &Facts) -> Value {
    let shape = format!("-1,{},3", facts.config.packed_points);
    let mut labels = array("clouds", "labels", file_set, "-1");
    labels["references"] = json!({"field": {"@id": "classes/label"}});
    let mut set = record_set("clouds", vec![array("clouds", "points", file_set, &shape), labels]);
    set["description"] = json!("Points: x, y, z, of mean 0 and scaled into the unit sphere");
    set
}

fn scans(file_set: &str, facts: &Facts) -> Value {
    let mut fields = vec![array("scan", "positions", file_set, "-1,3")];
    fields.extend(facts.config.attributes.iter().map(|attribute| {
        let shape = match Scan::default().slot(*attribute) {
            ColumnSlot::Vector(_) => "-1,3",
            _ => "-1,1",
        };
        array("scan", attribute.name(), file_set, shape)
    }));
    let mut set = record_set("scan", fields);
    set["description"] = json!("By point: metres, z upwards; seconds; radians");
    set
}

/// The label of each scan of a tar, which is a file beside the scan.
fn labels() -> Value {
    let mut label = field("label", "label", "sc:Integer");
    label["source"] =
        json!({"fileSet": {"@id": "label-files"}, "extract": {"fileProperty": "content"}});
    label["references"] = json!({"field": {"@id": "classes/label"}});
    record_set("label", vec![label])
}
