use crate::clouds::{Packed, Part, Scans};
use crate::config::{DatasetConfig, Layout};
use crate::error::DatasetError;
use crate::layout;
use crate::manifest::LayoutFile;
use crate::record::{Entry, MeshRecord};
use formats::scan_file::ScanFormat;
use formats::yanx27::Yanx27Writer;
use formats::{Split, hash};
use sim_gpu::internals::config::InvalidValue;
use std::collections::BTreeMap;
use std::path::Path;

/// Hexadecimal digits of the hash that tells equal names apart.
const HASH_DIGITS: usize = 12;

/// Most views of a mesh if each scan is a file of its own.
pub(crate) const MOST_VIEWS: usize = 65_535;

/// Checks that the layouts of `config` can hold a dataset of `classes`. It is called before a run,
/// since layouts are written at the end.
///
/// # Errors
/// A layout that this build cannot write, or that cannot hold the classes, the size of a cloud or
/// the number of views.
pub fn check_layouts(config: &DatasetConfig, classes: &[String]) -> Result<(), DatasetError> {
    for &layout in &config.layouts {
        match layout {
            Layout::Yanx27 => {
                Yanx27Writer::create(Path::new(""), classes.to_vec(), config.hash)?;
                refuse_if(config.packed_points < 2, layout, "a cloud needs two points or more")?;
            }
            Layout::ModelnetH5 => {
                let without = "this build has no HDF5: in a checkout, `cargo install --path edgepuck \
                               --features hdf5` builds one that has";
                refuse_if(cfg!(not(feature = "hdf5")), layout, without)?;
                refuse_if(classes.len() > 256, layout, "it has room for 256 classes")?;
            }
            Layout::Webdataset => {
                let others = config.layouts.len() > 1 || config.formats != [ScanFormat::Npz];
                refuse_if(others, layout, "it writes tars alone: name no other layout or format")?;
                let cause = "it holds the clouds of one sensor: name it with --sensor";
                refuse_if(config.sets.len() != 1, layout, cause)?;
            }
        }
    }
    Ok(check_views(config)?)
}

/// Checks that each mesh has no more views than `config` can hold.
pub(crate) fn check_views(config: &DatasetConfig) -> Result<(), InvalidValue> {
    let counts = config.sets.iter().map(|set| set.viewpoints.count());
    let most = counts.max().unwrap_or(0);
    if most > MOST_VIEWS && !config.layouts.contains(&Layout::Webdataset) {
        let cause = format!(
            "expected at most {MOST_VIEWS} where each scan is a file, found {most}; the layout \
             webdataset takes any number"
        );
        return Err(InvalidValue::new("views", cause));
    }
    Ok(())
}

fn refuse_if(unfit: bool, layout: Layout, cause: &'static str) -> Result<(), DatasetError> {
    if unfit { Err(DatasetError::Layout { layout: layout.name(), cause }) } else { Ok(()) }
}

/// Writes the layouts of the settings; returns their files, sorted.
pub(crate) fn write_layouts(scans: &Scans) -> Result<Vec<LayoutFile>, DatasetError> {
    check_layouts(scans.config, scans.classes)?;
    let mut files = Vec::new();
    for &layout in &scans.config.layouts {
        for set in &scans.config.sets {
            for &variant in &scans.config.variants {
                let folder = layout::export(scans.out, layout, set, variant);
                let parts = Split::ALL.map(|split| Part { set, variant, split });
                files.extend(match layout {
                    Layout::Yanx27 => write_yanx27(scans, &parts, &folder)?,
                    #[cfg(feature = "hdf5")]
                    Layout::ModelnetH5 => write_modelnet_h5(scans, &parts, &folder)?,
                    #[cfg(not(feature = "hdf5"))]
                    Layout::ModelnetH5 => unreachable!("invariant: check_layouts refuses it"),
                    Layout::Webdataset => unreachable!("invariant: `make` refuses it"),
                });
            }
        }
    }
    files.sort();
    // Both splits of one layout write the same list of classes.
    files.dedup();
    let listed = |file: hash::HashedFile| {
        let path = file.path.strip_prefix(scans.out).unwrap_or(&file.path);
        LayoutFile { file: layout::slashed(path), hash: file.hash }
    };
    Ok(files.into_iter().map(listed).collect())
}

fn write_yanx27<'a>(
    scans: &Scans<'a>,
    parts: &[Part<'a>],
    folder: &Path,
) -> Result<Vec<hash::HashedFile>, DatasetError> {
    let names = yanx27_names(scans.records);
    let mut writer = Yanx27Writer::create(folder, scans.classes.to_vec(), scans.config.hash)?;
    for part in parts {
        scans.for_each_cloud(part, |Packed { entry, view, cloud, .. }| {
            let name = names.get(entry).unwrap_or(&entry.name);
            let normals = cloud.normals.as_deref();
            Ok(writer.push(&entry.class, part.split, name, view, &cloud.points, normals)?)
        })?;
    }
    Ok(writer.finish()?)
}

/// New names for meshes that would share a file, since both splits are in one folder, file systems
/// may ignore case, and a class in front of the name is removed. A hash of the source is appended
/// to each.
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
        let digits = hash::of_bytes(record.source.as_bytes());
        format!("{}_{}", record.entry.name, &digits[..HASH_DIGITS])
    };
    let shared = alike.into_values().filter(|records| records.len() > 1).flatten();
    shared.map(|record| (&record.entry, renamed(record))).collect()
}

#[cfg(feature = "hdf5")]
fn write_modelnet_h5<'a>(
    scans: &Scans<'a>,
    parts: &[Part<'a>],
    folder: &Path,
) -> Result<Vec<hash::HashedFile>, DatasetError> {
    use formats::modelnet_h5::ModelNetH5Writer;
    let n_points = scans.config.packed_points as usize;
    let mut files = Vec::new();
    for part in parts {
        let classes = scans.classes.to_vec();
        let mut writer =
            ModelNetH5Writer::create(folder, part.split, n_points, classes, scans.config.hash);
        scans.for_each_cloud(part, |Packed { label, name, cloud, .. }| {
            Ok(writer.push(&cloud.points, label, &name)?)
        })?;
        files.extend(writer.finish()?);
    }
    Ok(files)
}
