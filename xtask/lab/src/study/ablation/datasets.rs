//! Makes one dataset, on the CPU, whose time is what costs are measured in.

use super::effects::{self, REFERENCE, Source, packed, surfaces};
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
use sim_gpu::internals::caster::{AdapterRequest, OpenCaster};
use sim_gpu::internals::job::Culling;
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A dataset on disk.
pub struct Made {
    /// Its name.
    pub name: &'static str,
    /// Where it lies.
    pub folder: PathBuf,
    /// The NPZ files of its scans, in one order for all datasets of the same meshes and
    /// views.
    pub scans: Vec<PathBuf>,
    /// How many meshes could not be used.
    pub failures: usize,
}

/// Makes the dataset `name` of `meshes` in `out`, unless it is there.
pub fn make(
    (name, source): (&'static str, Source),
    plan: &Plan,
    meshes: &[MeshEntry],
    out: &Path,
) -> anyhow::Result<Made> {
    let (scans, failures) = match source {
        Source::Scans(switches) => {
            let config = effects::scans(plan, switches)?;
            let caster = OpenCaster::open(&AdapterRequest::Cpu, &config.cast_effects())?;
            let terms = Terms::new(config, &caster, meshes, None);
            let manifest = match begin(out, &terms, Begin::Resume)? {
                Start::Complete(manifest) => *manifest,
                Start::Go => {
                    let (config, caster, progress) = (&terms.config, &caster, &Progress::default());
                    let is_over = &AtomicBool::new(false);
                    let run = Run { out, config, caster, culling: Culling::On, progress, is_over };
                    let scanned = scan_all(&run, meshes)?;
                    finish(out, &terms, scanned.records, scanned.failures)?
                }
            };
            // Every dataset is of the same meshes: the first names the failures.
            if name == REFERENCE {
                report_failures(&manifest.failures);
            }
            (scan_files(&manifest, out), manifest.failures.len())
        }
        Source::Surface | Source::Seen => (Vec::new(), draw(source, plan, meshes, out)?),
    };
    Ok(Made { name, folder: out.to_owned(), scans, failures })
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
pub fn bytes_per_cloud(made: &Made, source: Source) -> anyhow::Result<f64> {
    let (mut files, mut n) = (made.scans.clone(), made.scans.len());
    if files.is_empty() {
        for split in Split::ALL {
            let mut path = clouds(source, &made.folder).into_os_string();
            path.push(format!("-{split}.npz"));
            n += read_labelled(path.as_ref())?.len();
            files.push(path.into());
        }
    }
    let mut bytes = 0;
    for path in files {
        bytes += path.metadata().with_context(|| path.display().to_string())?.len();
    }
    Ok(bytes as f64 / n.max(1) as f64)
}

fn scan_files(manifest: &Manifest, folder: &Path) -> Vec<PathBuf> {
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
