//! Parts of a set of scenes, which any number of machines make, and the whole of them.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::Context;
use edgepuck_dataset::internals::{Part, check_parts, link};
use formats::FormatError;
use formats::atomic::{self, UnfinishedFolder};
use formats::labelled::{LabelledSet, read_labelled};
use formats::packed::{ClusterWriter, Remarks};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::shard::Shard;

/// The sets of packed clusters.
const SETS: [&str; 2] = ["train.npz", "test.npz"];

/// What a part says of itself.
#[derive(Serialize, Deserialize)]
struct Record {
    version: String,
    number: u32,
    of: u32,
    settings: Value,
}

/// The file of a part's record in its folder.
pub fn record(folder: &Path) -> PathBuf {
    folder.join("part.json")
}

/// Writes the record of a part that is complete. Parts of one whole have the same `settings`.
pub fn write_record(folder: &Path, shard: Shard, settings: Value) -> anyhow::Result<()> {
    let version = env!("CARGO_PKG_VERSION").to_owned();
    let record_of = Record { version, number: shard.number, of: shard.of, settings };
    let text = serde_json::to_vec_pretty(&record_of).context("writing JSON")?;
    Ok(atomic::write_bytes(&record(folder), text)?)
}

/// Joins the parts in these folders in the folder `out`, which then has the files of one run.
pub fn merge(folders: &[PathBuf], out: &Path) -> anyhow::Result<()> {
    let mut parts = folders.iter().map(|folder| read(folder)).collect::<Result<Vec<_>, _>>()?;
    let said = parts.iter().map(|(path, record)| {
        let Record { version, number, of, settings } = record;
        Part { path, number: *number, of: *of, version, settings }
    });
    check_parts(&said.collect::<Vec<_>>(), out)?;
    parts.sort_by_key(|(_, record)| record.number);
    let begun = UnfinishedFolder::begin(out);
    for (folder, _) in &parts {
        link_all(folder, out).with_context(|| folder.display().to_string())?;
    }
    for set in SETS {
        let of_part = |(folder, _): &(&Path, Record)| folder.join("packed").join(set);
        join(parts.iter().map(of_part), &out.join("packed").join(set))?;
    }
    begun.finish();
    Ok(())
}

fn read(folder: &Path) -> anyhow::Result<(&Path, Record)> {
    let file = record(folder);
    let lack = || match folder.is_dir() {
        true => "expected a part as of gen-scenes --shard, found a folder without part.json",
        false => "expected the folder of a part, found none",
    };
    let text = fs::read(&file).map_err(|error| match error.kind() {
        ErrorKind::NotFound => FormatError::malformed(folder, "part", lack()),
        _ => FormatError::io(&file, error),
    })?;
    let record = serde_json::from_slice(&text).map_err(|error| {
        FormatError::malformed(&file, "record", format!("expected that of a part: {error}"))
    })?;
    Ok((folder, record))
}

/// Links the files below `from` that parts do not share to the same places below `to`.
fn link_all(from: &Path, to: &Path) -> anyhow::Result<()> {
    for entry in fs::read_dir(from)? {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name()))?;
        if path.is_dir() {
            link_all(&path, &to.join(name))?;
        } else if path != record(from) && !SETS.iter().any(|set| path.ends_with(set)) {
            link(&path, &to.join(name))?;
        }
    }
    Ok(())
}

/// Writes the clusters of all `sets` to one, in order.
fn join(sets: impl Iterator<Item = PathBuf>, to: &Path) -> anyhow::Result<()> {
    let mut writer = None;
    for file in sets {
        let set = read_labelled(&file)?;
        let LabelledSet { classes, names, ids, sensor, range_m, truth_share, height_m, .. } = &set;
        let (texts, numbers) = ((classes, names, ids, sensor), (range_m, truth_share, height_m));
        let (
            (Some(classes), Some(names), Some(ids), Some(sensor)),
            (Some(range_m), Some(truth_share), Some(height_m)),
        ) = (texts, numbers)
        else {
            let cause = "expected all columns that gen-scenes writes";
            return Err(FormatError::malformed(&file, "clusters", cause).into());
        };
        let writer = match &mut writer {
            Some(writer) => writer,
            None => writer.insert(ClusterWriter::create(to, classes.clone())?),
        };
        for i in 0..set.len() {
            let remarks = Remarks {
                name: &names[i],
                id: &ids[i],
                sensor: &sensor[i],
                range_m: range_m[i],
                truth_share: truth_share[i],
                height_m: height_m[i],
            };
            writer.push(set.cloud(i), set.labels[i], &remarks)?;
        }
    }
    Ok(writer.map_or(Ok(()), ClusterWriter::finish)?)
}
