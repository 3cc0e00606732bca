//! Makes one dataset, on the CPU, whose time is what costs are measured in.

use super::effects::{REFERENCE, Source, packed, scans, surfaces};
use super::plan::Plan;
use crate::study::resume;
use anyhow::Context;
use edgepuck_dataset::finish::finish;
use edgepuck_dataset::journal::Terms;
use edgepuck_dataset::layout;
use edgepuck_dataset::manifest::Manifest;
use edgepuck_dataset::pipeline::{Run, scan_all};
use edgepuck_dataset::progress::Progress;
use edgepuck_dataset::start::{Begin, Start, begin};
use edgepuck_dataset::surfaces::write_surfaces;
use edgepuck_program::gen_dataset::report_failures;
use formats::atomic;
use formats::labelled::read_labelled;
use formats::scan_file::ScanFormat;
use formats::split::Split;
use sim_gpu::caster::AdapterRequest;
use sim_gpu::caster::Caster;
use sim_gpu::job::Culling;
use sim_gpu::mesh::tree::MeshEntry;
use std::path::{Path, PathBuf};

/// A dataset on disk.
pub struct Made {
    /// Its manifest, if it is of scans.
    pub manifest: Option<Manifest>,
    /// Its meshes that could not be used.
    pub failures: usize,
}

/// Makes the dataset `name` of `meshes` in `out`, unless it is there.
///
/// # Errors
/// A folder that holds another dataset; a file that cannot be written.
pub fn make(
    (name, source): (&str, Source),
    plan: &Plan,
    meshes: &[MeshEntry],
    out: &Path,
) -> anyhow::Result<Made> {
    match source {
        Source::Scans(switches) => {
            let config = scans(plan, switches)?;
            let caster = Caster::open(&AdapterRequest::Cpu, &config.cast_effects())?;
            let terms = Terms::new(config, &caster, meshes, None);
            let manifest = match begin(out, &terms, Begin::Resume)? {
                Start::Complete(manifest) => *manifest,
                Start::Go => {
                    let (config, caster, progress) = (&terms.config, &caster, &Progress::default());
                    let run = Run { out, config, caster, culling: Culling::On, progress };
                    let scanned = scan_all(&run, meshes)?;
                    finish(out, &terms, scanned.records, scanned.failures)?
                }
            };
            // Every dataset is of the same meshes: the first names the failures.
            if name == REFERENCE {
                report_failures(&manifest.failures);
            }
            let failures = manifest.failures.len();
            Ok(Made { manifest: Some(manifest), failures })
        }
        Source::Surface | Source::Seen => {
            Ok(Made { manifest: None, failures: draw(source, plan, meshes, out)? })
        }
    }
}

/// Draws points of surfaces; a note of how many meshes failed is written when
/// all else is.
fn draw(source: Source, plan: &Plan, meshes: &[MeshEntry], out: &Path) -> anyhow::Result<usize> {
    resume::result(&out.join("failures.txt"), || {
        atomic::sweep_leftovers(out)?;
        Ok(write_surfaces(out, &surfaces(plan, source), meshes)?.len())
    })
}

/// Where the packed clouds of the dataset in `folder` lie, as `train --data`
/// takes them.
pub fn clouds(source: Source, folder: &Path) -> PathBuf {
    match source {
        Source::Scans(_) => folder.join(packed()),
        Source::Surface => folder.join("surface"),
        Source::Seen => folder.join("seen"),
    }
}

/// Bytes of a cloud on disk: of a scan's file, or of a packed cloud where there
/// are no scans.
///
/// # Errors
/// A file that cannot be looked at.
pub fn bytes_per_cloud(made: &Made, source: Source, folder: &Path) -> anyhow::Result<f64> {
    let size = |path: &Path| {
        let data = path.metadata().with_context(|| path.display().to_string());
        data.map(|data| data.len())
    };
    let (mut bytes, mut n) = (0, 0);
    if let Some(manifest) = &made.manifest {
        for path in scan_files(manifest, folder) {
            bytes += size(&path)?;
            n += 1;
        }
    } else {
        for split in Split::ALL {
            let mut path = clouds(source, folder).into_os_string();
            path.push(format!("-{split}.npz"));
            let path = PathBuf::from(path);
            bytes += size(&path)?;
            n += read_labelled(&path)?.len();
        }
    }
    Ok(bytes as f64 / n.max(1) as f64)
}

/// The NPZ files of all scans of the dataset in `folder`, in one order for all
/// datasets of the same meshes and views.
pub fn scan_files(manifest: &Manifest, folder: &Path) -> Vec<PathBuf> {
    let files = manifest.meshes.iter().flat_map(|mesh| {
        mesh.scans.iter().flat_map(|scan| {
            scan.variants.iter().map(|written| {
                let (set, variant) = (&scan.set, written.variant);
                layout::scan(folder, set, variant, &mesh.entry, scan.view, ScanFormat::Npz)
            })
        })
    });
    files.collect()
}
