//! The layouts of other projects, beside our own.

use super::clouds::{Part, Scans};
use super::config::{DatasetConfig, Layout, SetConfig, Variant};
use super::error::DatasetError;
use super::layout;
use super::manifest::HashedFile;
use super::record::{Entry, MeshRecord};
use formats::yanx27::Yanx27Writer;
use formats::{Split, hash};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

/// Hexadecimal digits of a hash that set equal names apart.
const HASH_DIGITS: usize = 12;

/// Checks that the layouts that `config` asks for can hold a dataset of
/// `classes`: before a run, since they are written at its very end.
///
/// # Errors
/// A layout this build cannot write, or one without room for the classes or
/// the size of a cloud.
pub fn check_layouts(config: &DatasetConfig, classes: &[String]) -> Result<(), DatasetError> {
    for &layout in &config.layouts {
        match layout {
            Layout::Yanx27 => {
                Yanx27Writer::create(Path::new(""), classes.to_vec())?;
                refuse_if(config.packed_points < 2, layout, "a cloud needs two points or more")?;
            }
            Layout::ModelnetH5 => {
                let without = "this build has no HDF5: build with `--features hdf5`";
                refuse_if(cfg!(not(feature = "hdf5")), layout, without)?;
                refuse_if(classes.len() > 256, layout, "it has room for 256 classes")?;
            }
        }
    }
    Ok(())
}

fn refuse_if(unfit: bool, layout: Layout, cause: &'static str) -> Result<(), DatasetError> {
    if unfit { Err(DatasetError::Layout { layout: layout.name(), cause }) } else { Ok(()) }
}

/// Writes the layouts that are asked for; returns their files, sorted.
///
/// # Errors
/// As [`check_layouts`]; a scan that cannot be read or is not as recorded; a
/// file that cannot be written.
pub(super) fn write_layouts(scans: &Scans) -> Result<Vec<HashedFile>, DatasetError> {
    check_layouts(scans.config, scans.classes)?;
    let mut files = Vec::new();
    for &layout in &scans.config.layouts {
        for set in &scans.config.sets {
            for &variant in &scans.config.variants {
                let folder = layout::export(scans.out, layout, set, variant);
                files.extend(match layout {
                    Layout::Yanx27 => write_yanx27(scans, set, variant, &folder)?,
                    Layout::ModelnetH5 => write_modelnet_h5(scans, set, variant, &folder)?,
                });
            }
        }
    }
    files.sort();
    // Both splits of one layout write the same list of classes.
    files.dedup();
    let listed = |file: hash::HashedFile| {
        let path = file.path.strip_prefix(scans.out).unwrap_or(&file.path);
        HashedFile { file: layout::slashed(path), sha256: file.sha256 }
    };
    Ok(files.into_iter().map(listed).collect())
}

fn write_yanx27(
    scans: &Scans,
    set: &SetConfig,
    variant: Variant,
    folder: &Path,
) -> Result<Vec<hash::HashedFile>, DatasetError> {
    let names = yanx27_names(scans.records);
    let mut writer = Yanx27Writer::create(folder, scans.classes.to_vec())?;
    for split in Split::ALL {
        scans.for_each_cloud(&Part { set, variant, split }, |cloud| {
            let name = names.get(&cloud.entry).unwrap_or(&cloud.entry.name);
            let (class, normals) = (&cloud.entry.class, cloud.normals.as_deref());
            Ok(writer.push(class, split, name, cloud.view, &cloud.points, normals)?)
        })?;
    }
    Ok(writer.finish()?)
}

/// New names for meshes that would share a file: both splits lie in one
/// folder, where upper case may count as lower, and a class before the name
/// does not count at all. Each gets a hash of its source appended.
fn yanx27_names(records: &[MeshRecord]) -> BTreeMap<&Entry, String> {
    let place = |entry: &Entry| {
        let prefix = format!("{}_", entry.class);
        let name = entry.name.strip_prefix(&prefix).unwrap_or(&entry.name);
        (entry.class.to_lowercase(), name.to_lowercase())
    };
    let mut alike = BTreeMap::<_, Vec<&MeshRecord>>::new();
    for record in records {
        alike.entry(place(&record.entry)).or_default().push(record);
    }
    let renamed = |record: &MeshRecord| {
        let digits = hash::hexadecimal(&Sha256::digest(record.source.as_bytes()));
        format!("{}_{}", record.entry.name, &digits[..HASH_DIGITS])
    };
    let shared = alike.into_values().filter(|records| records.len() > 1).flatten();
    shared.map(|record| (&record.entry, renamed(record))).collect()
}

#[cfg(feature = "hdf5")]
fn write_modelnet_h5(
    scans: &Scans,
    set: &SetConfig,
    variant: Variant,
    folder: &Path,
) -> Result<Vec<hash::HashedFile>, DatasetError> {
    use formats::modelnet_h5::ModelNetH5Writer;
    let n_points = scans.config.packed_points as usize;
    let mut files = Vec::new();
    for split in Split::ALL {
        let mut writer = ModelNetH5Writer::create(folder, split, n_points, scans.classes.to_vec());
        scans.for_each_cloud(&Part { set, variant, split }, |cloud| {
            Ok(writer.push(&cloud.points, cloud.label, &cloud.name)?)
        })?;
        files.extend(writer.finish()?);
    }
    Ok(files)
}

#[cfg(not(feature = "hdf5"))]
fn write_modelnet_h5(
    scans: &Scans,
    _: &SetConfig,
    _: Variant,
    _: &Path,
) -> Result<Vec<hash::HashedFile>, DatasetError> {
    check_layouts(scans.config, scans.classes)?;
    Ok(Vec::new())
}
