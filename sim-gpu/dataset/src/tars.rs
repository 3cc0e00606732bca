//! A dataset as tars, as WebDataset reads them. Each is cast, written, hashed and handed over on
//! its own, and no scan is a file of its own: a billion clouds take some 15,000 tars of the default
//! size.
//!
//! `train-000012.tar` has its record beside it, `train-000012.json`. Each part of a run has a list
//! of its records, `part-0003-of-0008.json`, and the last part to end writes `dataset.json`, the
//! list of parts. On one adapter the tars have the same bytes, in any number of parts and after any
//! interruption.

use crate::error::DatasetError;
use crate::folder::{DatasetFolder, read_json, remove, write_json};
use crate::manifest::TOOL;
use crate::on_demand::Clouds;
use crate::plan::{Begin, Plan};
use crate::progress::Progress;
use crate::record::MeshFailure;
use edgepuck_mesh::tree::MeshEntry;
use formats::webdataset::{append_file, end, npz_of_clouds, npz_of_scan};
use formats::{Scan, Split, atomic};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim_gpu::Caster;
use sim_gpu::errors::InvalidValue;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::SeqCst;

use manifest::{MOST_TARS, is_of_part, other_dataset, part_file, tar_stem, write_root};
pub use manifest::{PartManifest, PartRecord, TarRecord};
pub(crate) use manifest::{RootManifest, is_unfinished, root_file};
use order::Order;

mod manifest;
mod order;

/// Clouds of a sample, if samples are clouds: 12 MiB at 1,024 points.
const CLOUDS_PER_SAMPLE: usize = 1024;

/// Points of a sample of several clouds at most: 384 MiB. The next sample is cast while one is
/// written.
const POINTS_PER_SAMPLE: usize = 1 << 25;

/// Scans that are cast together. The same number is written meanwhile.
const SCANS_AT_ONCE: usize = 128;

/// Bytes of the meshes that stay in memory.
const CACHE_BYTES: usize = 1 << 30;

formats::named! {
    /// The samples of a tar.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Sample: "sample" {
        /// 1,024 clouds of equal size and their labels.
        #[default]
        Clouds = "clouds",
        /// One scan, its label, and its class, mesh and view.
        Scan = "scan",
    }
}

/// How a dataset is cut into tars.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cut {
    /// The samples.
    pub sample: Sample,
    /// Clouds, or scans, of each tar except the last.
    pub clouds_per_tar: u32,
}

/// Where tars go.
#[derive(Clone, Copy)]
pub struct Tars<'a> {
    /// How they are cut.
    pub cut: Cut,
    /// Called for each tar that is made.
    pub on_made: &'a (dyn Fn(&TarRecord) + Sync),
    /// Moves a complete tar to its destination, or says why it cannot.
    pub hand_over: Option<HandOver<'a>>,
}

/// Moves a complete tar to its destination, or says why it cannot.
pub type HandOver<'a> = &'a (dyn Fn(&Path) -> Result<(), String> + Sync);

/// Makes the tars of `plan` that do not exist yet. A part has every N-th tar, of all meshes of the
/// plan.
///
/// # Errors
/// - [`DatasetError::Occupied`], [`DatasetError::InTheWay`] or [`DatasetError::Different`] if the
///   folder holds files that [`Plan::begin`] does not allow;
/// - settings of several sets, or effects that do not fit the sensor;
/// - [`DatasetError::Interrupted`] if [`Progress::stop`] was set before all tars were made;
/// - [`DatasetError::NotHandedOver`] if tars are complete but could not be handed over;
/// - a file that cannot be written, or an adapter that fails.
pub fn make_tars(
    plan: &Plan,
    tars: &Tars,
    caster: &Caster,
    progress: &Progress,
) -> Result<PartManifest, DatasetError> {
    plan.config.check()?;
    let part = plan.part.unwrap_or((0, 1));
    begin(plan, part)?;
    let made_by = made_by(plan, tars.cut, caster);
    let mut classes = Vec::new();
    let mut makers = Vec::new();
    for split in Split::ALL {
        let clouds = Clouds::new(plan.config.clone(), plan.meshes, Some(split), CACHE_BYTES)?;
        classes = clouds.classes().to_vec();
        let order = Order::new(plan.config.seed, split, &clouds);
        makers.push(Maker { plan, tars, caster, progress, split, order, clouds });
    }
    let mut wanted = Vec::new();
    for maker in &makers {
        let numbers = (part.0..maker.n_tars()?).step_by(part.1 as usize);
        wanted.extend(numbers.map(|number| (maker, number)));
    }
    let of = wanted.len();
    let interrupted = |done| DatasetError::Interrupted { done, of, what: "tars" };
    let (mut records, mut not_handed_over) = (Vec::new(), Vec::new());
    for (maker, number) in wanted {
        let Some(mut record) = maker.tar(number, &made_by)? else {
            return Err(interrupted(records.len()));
        };
        let cause = maker.hand_over(number, &mut record)?;
        let file = record.file.clone();
        records.push(record);
        match cause {
            None => {}
            // The signal may have ended the command as well.
            Some(_) if progress.stop.load(SeqCst) => return Err(interrupted(records.len())),
            Some(cause) => not_handed_over.push((file, cause)),
        }
    }
    let warnings = makers.iter().flat_map(|maker| maker.clouds.warnings());
    warnings.for_each(|warning| progress.note(warning));
    if let Some((first, cause)) = not_handed_over.first().cloned() {
        return Err(DatasetError::NotHandedOver { tars: not_handed_over.len(), first, cause });
    }
    let (tool, version) = (TOOL.to_owned(), env!("CARGO_PKG_VERSION").to_owned());
    let (config, cut, tars) = (plan.config.clone(), tars.cut, records);
    let manifest = PartManifest { tool, version, part, config, cut, classes, made_by, tars };
    write_json(&plan.out.join(part_file(part)), &manifest)?;
    write_root(plan.out, &manifest)?;
    Ok(manifest)
}

/// Checks that nothing in the folder is in the way of the tars of this part, or removes it. Files
/// of other parts stay, and so do those of the user.
fn begin(plan: &Plan, part: (u32, u32)) -> Result<(), DatasetError> {
    let occupied = |what| DatasetError::Occupied { path: plan.out.to_owned(), what };
    let folder = DatasetFolder(plan.out);
    let others = [folder.manifest_file(), folder.journal()];
    if let Some(path) = others.into_iter().find(|path| path.exists()) {
        return Err(DatasetError::InTheWay {
            path,
            what: "part of a dataset without tars".to_owned(),
        });
    }
    if plan.begin == Begin::Overwrite {
        folder.retract()?;
    }
    for entry in std::fs::read_dir(plan.out).into_iter().flatten().flatten() {
        let is_own = entry.file_name().to_str().is_some_and(|name| is_of_part(name, part));
        match plan.begin {
            Begin::Fresh if is_own => return Err(occupied("tars")),
            Begin::Overwrite if is_own => remove(&entry.path())?,
            _ => {}
        }
    }
    Ok(())
}

/// Makes the tars of one split.
struct Maker<'a> {
    plan: &'a Plan<'a>,
    tars: &'a Tars<'a>,
    caster: &'a Caster,
    progress: &'a Progress,
    split: Split,
    order: Order,
    clouds: Clouds,
}

/// The contents of a tar.
#[derive(Default)]
struct Filled {
    /// Clouds or scans.
    clouds: u64,
    /// By mesh.
    failures: BTreeMap<String, MeshFailure>,
}

/// Files of samples: their names and bytes.
type Files = Vec<(String, Vec<u8>)>;

impl Maker<'_> {
    fn n_tars(&self) -> Result<u32, InvalidValue> {
        let tars = self.order.len().div_ceil(self.tars.cut.clouds_per_tar as usize);
        let too_many = || format!("expected at most {MOST_TARS} tars of a split, found {tars}");
        let number = u32::try_from(tars).ok().filter(|tars| *tars <= MOST_TARS);
        number.ok_or_else(|| InvalidValue::new("clouds_per_tar", too_many()))
    }

    fn record_file(&self, number: u32) -> PathBuf {
        self.plan.out.join(tar_stem(self.split, number) + ".json")
    }

    fn is_stopped(&self) -> bool {
        self.progress.stop.load(SeqCst)
    }

    /// The record of tar `number`, which is made unless it exists; `None` if the run was stopped.
    fn tar(&self, number: u32, made_by: &str) -> Result<Option<TarRecord>, DatasetError> {
        let path = self.record_file(number);
        if path.exists() {
            let record: TarRecord = read_json(&path)?;
            if record.made_by != made_by {
                return Err(other_dataset(path, ""));
            }
            let tar = std::fs::metadata(self.plan.out.join(&record.file));
            if record.handed_over || tar.is_ok_and(|tar| tar.len() == record.bytes) {
                return Ok(Some(record));
            }
            // Its tar is torn or gone.
            remove(&path)?;
        }
        if self.is_stopped() {
            return Ok(None);
        }
        let Some(record) = self.write(number, made_by)? else { return Ok(None) };
        write_json(&path, &record)?;
        (self.tars.on_made)(&record);
        Ok(Some(record))
    }

    /// Hands tar `number` over, unless it was already; returns why it could not be.
    fn hand_over(
        &self,
        number: u32,
        record: &mut TarRecord,
    ) -> Result<Option<String>, DatasetError> {
        let Some(hand_over) = self.tars.hand_over.filter(|_| !record.handed_over) else {
            return Ok(None);
        };
        if self.is_stopped() {
            return Ok(Some("the run was stopped".to_owned()));
        }
        if let Err(cause) = hand_over(&self.plan.out.join(&record.file)) {
            return Ok(Some(cause));
        }
        record.handed_over = true;
        write_json(&self.record_file(number), record)?;
        Ok(None)
    }

    /// Writes tar `number` completely or, if the run is stopped, not at all.
    fn write(&self, number: u32, made_by: &str) -> Result<Option<TarRecord>, DatasetError> {
        let file = tar_stem(self.split, number) + ".tar";
        let path = self.plan.out.join(&file);
        let mut filled = Ok(None);
        let hash = atomic::write_hashed(&path, self.plan.config.hash, |tar| {
            filled = self.fill(tar, number, &path);
            match &filled {
                Ok(Some(_)) => Ok(()),
                // `write_hashed` removes the file that is not complete.
                _ => Err(io::Error::other("the tar is not complete")),
            }
        });
        let Some(Filled { clouds, failures }) = filled? else { return Ok(None) };
        let hash = hash?;
        let bytes = std::fs::metadata(&path).map_err(|error| DatasetError::io(&path, error))?.len();
        let failures = failures.into_values().collect();
        let (made_by, handed_over) = (made_by.to_owned(), false);
        Ok(Some(TarRecord { file, hash, bytes, clouds, failures, handed_over, made_by }))
    }

    /// Writes the samples of tar `number` at `path`, or returns `None` if the run is stopped before
    /// the end. One sample is written while the next is cast.
    fn fill(
        &self,
        tar: &mut (impl io::Write + Send),
        number: u32,
        path: &Path,
    ) -> Result<Option<Filled>, DatasetError> {
        let size = self.tars.cut.clouds_per_tar as usize;
        let first = number as usize * size;
        let places: Vec<usize> = (first..self.order.len().min(first + size)).collect();
        let stem = tar_stem(self.split, number);
        let at_once = match self.tars.cut.sample {
            Sample::Clouds => clouds_per_sample(self.plan.config.packed_points),
            Sample::Scan => SCANS_AT_ONCE,
        };
        let (mut filled, mut files) = (Filled::default(), Files::new());
        let write = |error| DatasetError::io(path, error);
        for (nth, places) in places.chunks(at_once).chain([&[][..]]).enumerate() {
            if self.is_stopped() {
                return Ok(None);
            }
            let (written, cast) = rayon::join(
                || files.iter().try_for_each(|(name, bytes)| append_file(tar, name, bytes)),
                || self.cast(&format!("{stem}-{nth:03}"), places, &mut filled),
            );
            written.map_err(write)?;
            files = cast?;
        }
        end(tar).map_err(write)?;
        Ok(Some(filled))
    }

    /// Casts the clouds or scans at these `places` of the split. Clouds are one sample called
    /// `name`; each scan is a sample whose key is its place.
    fn cast(
        &self,
        name: &str,
        places: &[usize],
        filled: &mut Filled,
    ) -> Result<Files, DatasetError> {
        if places.is_empty() {
            return Ok(Files::new());
        }
        let indices: Vec<usize> = places.iter().map(|&place| self.order.at(place)).collect();
        let (caster, config) = (self.caster, self.plan.config);
        let in_memory = |error| DatasetError::io(Path::new(name), error);
        match self.tars.cut.sample {
            Sample::Clouds => {
                let drawn = self.clouds.draw_each(caster, config.seed, &indices)?;
                let drawn = self.kept(drawn, &indices, filled)?;
                let label = |nth: usize| self.clouds.label(indices[nth]);
                let clouds: Vec<_> =
                    drawn.into_iter().map(|(nth, points)| (points, label(nth))).collect();
                let npz = npz_of_clouds(&clouds, config.packed_points as usize);
                Ok(vec![(format!("{name}.npz"), npz.map_err(in_memory)?)])
            }
            Sample::Scan => {
                let scans = self.clouds.scan_each(caster, config.seed, &indices)?;
                let scans = self.kept(scans, &indices, filled)?;
                let files = scans.par_iter().map(|(nth, scan)| {
                    self.files_of_scan(places[*nth], indices[*nth], scan).map_err(in_memory)
                });
                Ok(files.collect::<Result<Vec<_>, _>>()?.concat())
            }
        }
    }

    /// The sample of one scan.
    fn files_of_scan(&self, place: usize, index: usize, scan: &Scan) -> io::Result<Files> {
        let (mesh, view) = (self.clouds.mesh(index), self.clouds.view(index));
        let description = serde_json::json!({
            "class": mesh.class, "mesh": mesh.relative, "view": view, "points": scan.len(),
        });
        let files = [
            ("cls", self.clouds.label(index).to_string().into_bytes()),
            ("json", description.to_string().into_bytes()),
            ("npz", npz_of_scan(scan)?),
        ];
        Ok(files.map(|(kind, bytes)| (format!("{place:012}.{kind}"), bytes)).into())
    }

    /// The results of `made` that are no errors, with their positions in `made`, counted in
    /// `filled`. Errors of a mesh become failures there.
    fn kept<T>(
        &self,
        made: Vec<Result<T, DatasetError>>,
        indices: &[usize],
        filled: &mut Filled,
    ) -> Result<Vec<(usize, T)>, DatasetError> {
        let mut kept = Vec::with_capacity(made.len());
        for (nth, made) in made.into_iter().enumerate() {
            let mesh = self.clouds.mesh(indices[nth]);
            let failure = match made {
                Ok(made) => {
                    kept.push((nth, made));
                    continue;
                }
                Err(DatasetError::Mesh(failure)) => failure,
                Err(sparse @ DatasetError::Sparse { .. }) => MeshFailure::new(mesh, sparse),
                Err(other) => return Err(other),
            };
            filled.failures.insert(mesh.relative.clone(), failure);
        }
        filled.clouds += kept.len() as u64;
        Ok(kept)
    }
}

/// A digest of everything that decides the bytes of the tars. It has the names and the sizes of
/// mesh files; hashing their contents would take as long as reading them all.
fn made_by(plan: &Plan, cut: Cut, caster: &Caster) -> String {
    let size = |mesh: &MeshEntry| std::fs::metadata(&mesh.path).map_or(0, |file| file.len());
    let meshes: Vec<(&str, u64)> =
        plan.meshes.iter().map(|mesh| (mesh.relative.as_str(), size(mesh))).collect();
    let (version, adapter) = (env!("CARGO_PKG_VERSION"), caster.name());
    let all = serde_json::json!([version, adapter, plan.config, cut, meshes]);
    formats::hash::of_bytes(all.to_string().as_bytes())
}

fn clouds_per_sample(n_points: u32) -> usize {
    (POINTS_PER_SAMPLE / n_points.max(1) as usize).clamp(1, CLOUDS_PER_SAMPLE)
}
