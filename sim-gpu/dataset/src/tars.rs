//! A dataset as tars, as WebDataset reads them. Each is cast, written, hashed and handed over by
//! itself, and no scan is a file of its own: a billion clouds are some 15,000 tars of the default size.
//!
//! `train-000012.tar` has a record beside it, `train-000012.json`. Each part of a run has a list of its
//! records, `part-0003-of-0008.json`, and the last part that ends writes `dataset.json`, the list of
//! parts. Cast by one adapter, all have the same bytes whenever and by however many they are made.

use super::config::DatasetConfig;
use super::error::DatasetError;
use super::journal::{read_json, write_json};
use super::layout;
use super::manifest::TOOL;
use super::mesh::failed;
use super::on_demand::Clouds;
use super::record::MeshFailure;
use formats::webdataset::{append_file, end, npz_of_clouds, npz_of_scan};
use formats::{Split, atomic};
use serde::{Deserialize, Serialize};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::config::InvalidValue;
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};

use manifest::{MOST_TARS, other_dataset, part_file, tar_stem, write_root};
pub use manifest::{
    PartManifest, PartRecord, RootManifest, TarRecord, is_of_part, is_unfinished, root_file, verify,
};
use order::Order;

mod manifest;
mod order;

/// Clouds of one sample, where samples are of clouds: 12 MiB at 1,024 points.
const CLOUDS_PER_SAMPLE: usize = 1024;

/// Points of one sample at most, but for one cloud: 384 MiB. While one sample is written, the next is in
/// memory as well.
const POINTS_PER_SAMPLE: usize = 1 << 25;

/// Scans that are cast together; as many are written meanwhile.
const SCANS_AT_ONCE: usize = 128;

/// Bytes of meshes that stay in memory.
const CACHE_BYTES: usize = 1 << 30;

formats::named! {
    /// What one sample of a tar is.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Sample: "sample" {
        /// 1,024 clouds of equal size and their labels.
        #[default]
        Clouds = "clouds",
        /// One scan, its label, and what it is of.
        Scan = "scan",
    }
}

/// How a dataset is cut into tars.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cut {
    /// What a sample is.
    pub sample: Sample,
    /// Clouds, or scans, of each tar but the last.
    pub clouds_per_tar: u32,
}

/// Takes a complete tar to where it is to be kept.
pub type HandOver<'a> = &'a (dyn Fn(&Path) -> Result<(), String> + Sync);

/// A part of a dataset to be made.
pub struct Run<'a> {
    /// The folder of the tars.
    pub out: &'a Path,
    /// What they are to hold: of one set.
    pub config: &'a DatasetConfig,
    /// How they are cut.
    pub cut: Cut,
    /// Part (number from 0, of N): every N-th tar.
    pub part: (u32, u32),
    /// Casts the rays.
    pub caster: &'a OpenCaster,
    /// Set by whoever wants the run to end; the tar that is being made is left out.
    pub is_over: &'a AtomicBool,
    /// Given each tar once it is complete, if anybody takes them; says why it could not be handed over.
    pub hand_over: Option<HandOver<'a>>,
    /// Given a line when a tar is done.
    pub say: &'a (dyn Fn(String) + Sync),
}

/// Makes the tars of a part that are not there yet, of `meshes`, which are all of the dataset.
///
/// # Errors
/// More sets than one or effects that do not fit the sensor; tars of another dataset in the folder; a
/// file that cannot be written; a failing adapter; [`DatasetError::Interrupted`] if the run was told to
/// end; [`DatasetError::NotHandedOver`].
pub fn make(run: &Run, meshes: &[MeshEntry]) -> Result<PartManifest, DatasetError> {
    let made_by = made_by(run, meshes);
    let mut classes = Vec::new();
    let (mut tars, mut not_handed_over) = (Vec::new(), Vec::new());
    let mut halves = Vec::new();
    for split in Split::ALL {
        let clouds = Clouds::new(run.config.clone(), meshes, Some(split), CACHE_BYTES)?;
        classes = clouds.classes().to_vec();
        let half = Half { run, split, order: Order::new(run.config.seed, split, &clouds), clouds };
        let numbers = (run.part.0..half.tars()?).step_by(run.part.1 as usize);
        halves.push((half, numbers));
    }
    let wanted = halves.iter().map(|(_, numbers)| numbers.len()).sum();
    let interrupted = |done| DatasetError::Interrupted { done, of: wanted, what: "tars" };
    for (half, numbers) in halves {
        for number in numbers {
            let Some(mut record) = half.tar(number, &made_by)? else {
                return Err(interrupted(tars.len()));
            };
            let cause = half.hand_over(number, &mut record)?;
            let file = record.file.clone();
            tars.push(record);
            match cause {
                None => {}
                // The signal may have ended the command as well.
                Some(_) if run.is_over.load(SeqCst) => return Err(interrupted(tars.len())),
                Some(cause) => not_handed_over.push((file, cause)),
            }
        }
    }
    if let Some((first, cause)) = not_handed_over.first().cloned() {
        return Err(DatasetError::NotHandedOver { tars: not_handed_over.len(), first, cause });
    }
    let (tool, version) = (TOOL.to_owned(), env!("CARGO_PKG_VERSION").to_owned());
    let Run { config, cut, part, out, .. } = *run;
    let manifest =
        PartManifest { tool, version, part, config: config.clone(), cut, classes, made_by, tars };
    write_json(&out.join(part_file(part)), &manifest)?;
    write_root(out, &manifest)?;
    Ok(manifest)
}

/// The tars of one split.
struct Half<'a> {
    run: &'a Run<'a>,
    split: Split,
    clouds: Clouds,
    order: Order,
}

/// What a tar was filled with.
#[derive(Default)]
struct Filled {
    /// Clouds or scans.
    clouds: u64,
    /// By mesh.
    failures: BTreeMap<String, MeshFailure>,
}

/// What was cast and is to be written.
enum Cast {
    /// Points and labels.
    Clouds(Vec<(Vec<[f32; 3]>, usize)>),
    /// Scans, each with its place in the split and its number among [`Clouds`].
    Scans(Vec<(usize, usize, formats::Scan)>),
}

impl Half<'_> {
    fn tars(&self) -> Result<u32, InvalidValue> {
        let tars = self.order.len().div_ceil(self.run.cut.clouds_per_tar as usize);
        let too_many = || format!("expected at most {MOST_TARS} tars of a split, found {tars}");
        let number = u32::try_from(tars).ok().filter(|tars| *tars <= MOST_TARS);
        number.ok_or_else(|| InvalidValue::new("clouds_per_tar", too_many()))
    }

    fn name(&self, number: u32) -> String {
        tar_stem(self.split, number)
    }

    fn record(&self, number: u32) -> PathBuf {
        self.run.out.join(self.name(number) + ".json")
    }

    /// The record of tar `number`, which is made if there is none; `None` if the run is over.
    fn tar(&self, number: u32, made_by: &str) -> Result<Option<TarRecord>, DatasetError> {
        let path = self.record(number);
        if path.exists() {
            let record: TarRecord = read_json(&path)?;
            if record.made_by != made_by {
                return Err(other_dataset(path, ""));
            }
            if record.handed_over || self.is_there(&record) {
                return Ok(Some(record));
            }
            // Its tar is torn or gone.
            layout::remove(&path)?;
        }
        if self.run.is_over.load(SeqCst) {
            return Ok(None);
        }
        let Some(record) = self.write(number, made_by)? else { return Ok(None) };
        write_json(&path, &record)?;
        let TarRecord { file, bytes, clouds, .. } = &record;
        (self.run.say)(format!("{file}: {clouds} clouds, {} MiB", bytes >> 20));
        Ok(Some(record))
    }

    /// Hands tar `number` over, unless it was or nobody takes it; says why it could not be.
    fn hand_over(
        &self,
        number: u32,
        record: &mut TarRecord,
    ) -> Result<Option<String>, DatasetError> {
        let Some(hand_over) = self.run.hand_over.filter(|_| !record.handed_over) else {
            return Ok(None);
        };
        if self.run.is_over.load(SeqCst) {
            return Ok(Some("the run is over".to_owned()));
        }
        if let Err(cause) = hand_over(&self.run.out.join(&record.file)) {
            return Ok(Some(cause));
        }
        record.handed_over = true;
        write_json(&self.record(number), record)?;
        Ok(None)
    }

    /// Whether the tar of `record` is complete.
    fn is_there(&self, record: &TarRecord) -> bool {
        std::fs::metadata(self.run.out.join(&record.file))
            .is_ok_and(|file| file.len() == record.bytes)
    }

    /// Writes tar `number`, all of it or, if the run is over, nothing.
    fn write(&self, number: u32, made_by: &str) -> Result<Option<TarRecord>, DatasetError> {
        let file = self.name(number) + ".tar";
        let path = self.run.out.join(&file);
        let mut filled = Ok(None);
        let hash = atomic::write_hashed(&path, self.run.config.hash, |tar| {
            filled = self.fill(tar, number, &path);
            match &filled {
                Ok(Some(_)) => Ok(()),
                // What was written so far is removed.
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

    /// Writes the samples of tar `number`, which is at `path`; `None` if the run is over before all
    /// are there. One sample is written while the next is cast.
    fn fill(
        &self,
        tar: &mut (impl io::Write + Send),
        number: u32,
        path: &Path,
    ) -> Result<Option<Filled>, DatasetError> {
        let size = self.run.cut.clouds_per_tar as usize;
        let first = number as usize * size;
        let places: Vec<usize> = (first..self.order.len().min(first + size)).collect();
        let at_once = match self.run.cut.sample {
            Sample::Clouds => clouds_per_sample(self.run.config.packed_points),
            Sample::Scan => SCANS_AT_ONCE,
        };
        let mut filled = Filled::default();
        let mut cast: Option<Cast> = None;
        for (nth, next) in places.chunks(at_once).map(Some).chain([None]).enumerate() {
            if self.run.is_over.load(SeqCst) {
                return Ok(None);
            }
            let (written, made) = rayon::join(
                || cast.map_or(Ok(()), |cast| self.append(tar, number, nth - 1, cast)),
                || next.map(|places| self.cast(places, &mut filled)).transpose(),
            );
            written.map_err(|error| DatasetError::io(path, error))?;
            cast = made?;
        }
        end(tar).map_err(|error| DatasetError::io(path, error))?;
        Ok(Some(filled))
    }

    /// Casts what comes at these `places`.
    fn cast(&self, places: &[usize], filled: &mut Filled) -> Result<Cast, DatasetError> {
        let indices: Vec<usize> = places.iter().map(|&place| self.order.at(place)).collect();
        let (caster, seed) = (self.run.caster, self.run.config.seed);
        Ok(match self.run.cut.sample {
            Sample::Clouds => {
                let drawn = self.clouds.draw_each(caster, seed, &indices)?;
                let kept = self.kept(drawn, &indices, filled)?;
                Cast::Clouds(
                    kept.into_iter().map(|(_, cloud)| (cloud.points, cloud.label)).collect(),
                )
            }
            Sample::Scan => {
                let cast = self.clouds.scan_each(caster, seed, &indices)?;
                let kept = self.kept(cast, &indices, filled)?;
                let placed = |(nth, scan)| (places[nth], indices[nth], scan);
                Cast::Scans(kept.into_iter().map(placed).collect())
            }
        })
    }

    /// Appends what was cast: sample `nth` of tar `number`, or a sample of each scan.
    fn append(
        &self,
        tar: &mut impl io::Write,
        number: u32,
        nth: usize,
        cast: Cast,
    ) -> io::Result<()> {
        match cast {
            Cast::Clouds(clouds) => {
                let npz = npz_of_clouds(&clouds, self.run.config.packed_points as usize)?;
                append_file(tar, &format!("{}-{nth:03}.npz", self.name(number)), &npz)
            }
            Cast::Scans(scans) => scans
                .iter()
                .try_for_each(|(place, index, scan)| self.append_scan(tar, *place, *index, scan)),
        }
    }

    /// What was made of the clouds of these `indices`, with the place of each among them, and counted
    /// in `filled`; meshes of which nothing can be made become failures there.
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
                Err(sparse @ DatasetError::Sparse { .. }) => failed(mesh, None, sparse.to_string()),
                Err(other) => return Err(other),
            };
            filled.failures.insert(mesh.relative.clone(), failure);
        }
        filled.clouds += kept.len() as u64;
        Ok(kept)
    }

    /// Appends a sample of one scan, whose key is its number in the split.
    fn append_scan(
        &self,
        tar: &mut impl io::Write,
        place: usize,
        index: usize,
        scan: &formats::Scan,
    ) -> io::Result<()> {
        let (mesh, view) = (self.clouds.mesh(index), self.clouds.view(index));
        let told = serde_json::json!({
            "class": mesh.class, "mesh": mesh.relative, "view": view, "points": scan.len(),
        });
        let label = self.clouds.label(index).to_string();
        append_file(tar, &format!("{place:012}.cls"), label.as_bytes())?;
        append_file(tar, &format!("{place:012}.json"), told.to_string().as_bytes())?;
        append_file(tar, &format!("{place:012}.npz"), &npz_of_scan(scan)?)
    }
}

/// A digest of what decides the bytes of all tars. Of meshes it takes the names and the sizes of their
/// files: to hash their contents would take as long as to read them all.
fn made_by(run: &Run, meshes: &[MeshEntry]) -> String {
    let size = |mesh: &MeshEntry| std::fs::metadata(&mesh.path).map_or(0, |file| file.len());
    let meshes: Vec<(&str, u64)> =
        meshes.iter().map(|mesh| (mesh.relative.as_str(), size(mesh))).collect();
    let adapter = run.caster.name();
    let all = serde_json::json!([env!("CARGO_PKG_VERSION"), adapter, run.config, run.cut, meshes]);
    formats::hash::of_bytes(all.to_string().as_bytes())
}

/// Clouds of this many points that one sample holds.
fn clouds_per_sample(n_points: u32) -> usize {
    (POINTS_PER_SAMPLE / n_points.max(1) as usize).clamp(1, CLOUDS_PER_SAMPLE)
}
