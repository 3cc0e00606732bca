//! The clouds of a dataset, cast as they are asked for.
//!
//! They are those that [`pipeline`](super::pipeline) and [`finish`](super::finish) would pack for
//! the same configuration, to the byte: but nothing is written, and another seed gives other
//! views of the same meshes.

use super::clouds::Source;
use super::config::{DatasetConfig, Variant, Viewpoints};
use super::error::DatasetError;
use super::mesh::{PlannedView, failure, materials, placed, read};
use super::record::{Cloud, Entry};
use formats::hash::Hashing;
use formats::rng::StreamKey;
use formats::{Scan, Split};
use rayon::prelude::*;
use sim_gpu::effects::Effects;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::config::InvalidValue;
use sim_gpu::internals::job::{Cast, CastJob};
use sim_gpu::internals::material::Materials;
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::resolve::resolve;
use sim_gpu::internals::scan::{ObjectHits, assemble};
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::{Surface, Target};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// How many views of a mesh are tried until one has enough points.
const ATTEMPTS: u32 = 8;

/// Meshes from places around them: cloud `i` is of view `i % views` of mesh `i / views`.
pub struct Clouds {
    config: DatasetConfig,
    variant: Variant,
    meshes: Vec<MeshEntry>,
    classes: Vec<String>,
    patterns: Vec<BeamPattern>,
    cache: Mutex<Cache>,
}

/// A mesh in memory.
struct Ready {
    entry: Entry,
    target: Target,
    materials: Option<Materials>,
}

/// A cloud and its class.
pub struct Labelled {
    /// `[packed_points]`, in the unit sphere.
    pub points: Vec<[f32; 3]>,
    /// The class, as an index into [`Clouds::classes`].
    pub label: usize,
}

impl Clouds {
    /// The clouds of those of `meshes` that are of `split`, or of all, for the one set of `config`,
    /// noisy ones where it asks for noise. `meshes`, sorted by class, are all of the dataset: labels
    /// are places among their classes. Meshes that were read stay in memory up to `cache_bytes`.
    ///
    /// # Errors
    /// If there is not one set, if meshes are to be simplified, or if the effects do not fit the
    /// sensor.
    pub fn new(
        config: DatasetConfig,
        meshes: &[MeshEntry],
        split: Option<Split>,
        cache_bytes: usize,
    ) -> Result<Self, InvalidValue> {
        let [set] = &config.sets[..] else {
            let cause = format!("expected one set, found {}", config.sets.len());
            return Err(InvalidValue::new("sets", cause));
        };
        if config.simplify.is_some() {
            let cause = "expected none: meshes are read for one view at a time";
            return Err(InvalidValue::new("simplify", cause));
        }
        if let Viewpoints::Views(views) = &set.viewpoints {
            views.validate()?;
        }
        config.effects.for_sensor(&set.sensor)?;
        let patterns = vec![config.effects.widen(set.sensor.pattern(), &set.sensor)?];
        let variant =
            if config.variants.contains(&Variant::Noisy) { Variant::Noisy } else { Variant::Clean };
        let cache = Mutex::new(Cache::new(cache_bytes));
        let config = DatasetConfig { hash: Hashing::None, ..config };
        let mut classes: Vec<String> = meshes.iter().map(|mesh| mesh.class.clone()).collect();
        classes.dedup();
        let is_asked = |mesh: &&MeshEntry| split.is_none_or(|split| mesh.split == split);
        let meshes = meshes.iter().filter(is_asked).cloned().collect();
        Ok(Self { config, variant, meshes, classes, patterns, cache })
    }

    /// How many clouds there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.meshes.len() * self.views()
    }

    /// Whether there is no cloud.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The classes' names, sorted.
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// The mesh that cloud `index` is of.
    #[must_use]
    pub fn mesh(&self, index: usize) -> &MeshEntry {
        &self.meshes[index / self.views()]
    }

    /// The class of cloud `index`, without casting it.
    #[must_use]
    pub fn label(&self, index: usize) -> usize {
        let class = &self.mesh(index).class;
        self.classes.partition_point(|known| known < class)
    }

    /// What the clouds are of.
    #[must_use]
    pub fn config(&self) -> &DatasetConfig {
        &self.config
    }

    /// Which view of its mesh cloud `index` is of.
    #[must_use]
    pub fn view(&self, index: usize) -> u32 {
        (index % self.views()) as u32
    }

    /// The effects that a caster of these clouds models.
    #[must_use]
    pub fn cast_effects(&self) -> Effects {
        self.config.cast_effects()
    }

    /// The clouds of these numbers, with the random numbers of `seed`. A view that has too few
    /// points for a cloud is replaced by one of another seed.
    ///
    /// # Errors
    /// A mesh that cannot be read, or of which no view has enough points; a failing adapter.
    pub fn draw(
        &self,
        caster: &OpenCaster,
        seed: u64,
        indices: &[usize],
    ) -> Result<Vec<Labelled>, DatasetError> {
        self.draw_each(caster, seed, indices)?.into_iter().collect()
    }

    /// As [`Clouds::draw`], where each cloud may fail by itself.
    ///
    /// # Errors
    /// A failing adapter.
    pub fn draw_each(
        &self,
        caster: &OpenCaster,
        seed: u64,
        indices: &[usize],
    ) -> Result<Vec<Result<Labelled, DatasetError>>, DatasetError> {
        let drawn = self.make_each(caster, seed, indices, |config, source, scan| {
            Cloud::draw(config, source, &scan).map(|cloud| cloud.points)
        })?;
        let labelled = |(made, &index): (Result<Vec<[f32; 3]>, _>, _)| {
            made.map(|points| Labelled { points, label: self.label(index) })
        };
        Ok(drawn.into_iter().zip(indices).map(labelled).collect())
    }

    /// The scans that those clouds are of, each of which may fail by itself.
    ///
    /// # Errors
    /// A failing adapter.
    pub fn scan_each(
        &self,
        caster: &OpenCaster,
        seed: u64,
        indices: &[usize],
    ) -> Result<Vec<Result<Scan, DatasetError>>, DatasetError> {
        self.make_each(caster, seed, indices, |config, _, scan| {
            (scan.len() as u64 >= u64::from(config.min_points)).then_some(scan)
        })
    }

    /// What `make` makes of the scan of each view, or of one that takes its place if it makes
    /// nothing of it.
    fn make_each<T: Send>(
        &self,
        caster: &OpenCaster,
        seed: u64,
        indices: &[usize],
        make: impl Fn(&DatasetConfig, Source, Scan) -> Option<T> + Sync,
    ) -> Result<Vec<Result<T, DatasetError>>, DatasetError> {
        let mut most_points = vec![0; indices.len()];
        let mut made: Vec<Option<Result<T, DatasetError>>> = indices.iter().map(|_| None).collect();
        for attempt in 0..ATTEMPTS {
            let missing: Vec<usize> = (0..indices.len()).filter(|&i| made[i].is_none()).collect();
            if missing.is_empty() {
                break;
            }
            let seed = match attempt {
                0 => seed,
                _ => other_seed(seed, "another view", attempt),
            };
            let config = DatasetConfig { seed, ..self.config.clone() };
            let asked: Vec<usize> = missing.iter().map(|&i| indices[i]).collect();
            for (&i, found) in missing.iter().zip(self.cast(caster, &config, &asked, &make)?) {
                match found {
                    Ok((points, of_view)) => {
                        most_points[i] = points.max(most_points[i]);
                        made[i] = of_view.map(Ok);
                    }
                    Err(error) => made[i] = Some(Err(error)),
                }
            }
        }
        let made = made.into_iter().zip(indices).zip(most_points);
        let sparse = |index, most| DatasetError::Sparse {
            source_file: self.mesh(index).relative.clone(),
            least: self.config.min_points,
            most,
            tried: ATTEMPTS,
        };
        Ok(made
            .map(|((made, &index), most)| made.unwrap_or_else(|| Err(sparse(index, most))))
            .collect())
    }

    fn views(&self) -> usize {
        self.config.sets[0].viewpoints.count()
    }

    /// Casts some views together. Of each, how many points its scan has, and what `make` makes of
    /// it.
    #[expect(clippy::type_complexity, reason = "what may fail for each view, and what for all")]
    fn cast<T: Send>(
        &self,
        caster: &OpenCaster,
        config: &DatasetConfig,
        indices: &[usize],
        make: &(impl Fn(&DatasetConfig, Source, Scan) -> Option<T> + Sync),
    ) -> Result<Vec<Result<(u64, Option<T>), DatasetError>>, DatasetError> {
        let aimed: Vec<Result<Aimed, DatasetError>> =
            indices.par_iter().map(|&index| self.aim(config, index)).collect();
        let jobs: Vec<CastJob> = aimed.iter().flatten().map(|aimed| aimed.job.clone()).collect();
        let fits = jobs.iter().all(|job| caster.fits(&job.target));
        let casts = if fits { caster.cast(&jobs)? } else { caster.cast_on_cpu(&jobs) };
        let effects = config.cast_effects();
        let mut casts = casts.into_iter();
        let aimed: Vec<_> = aimed
            .into_iter()
            .map(|aimed| aimed.map(|aimed| (aimed, casts.next().unwrap_or_default())))
            .collect();
        let made = aimed.into_par_iter().map(|aimed| {
            let (aimed, cast) = aimed?;
            self.make(config, &effects, &aimed, &cast, make)
        });
        Ok(made.collect())
    }

    fn aim(&self, config: &DatasetConfig, index: usize) -> Result<Aimed, DatasetError> {
        let mesh = self.ready(index / self.views())?;
        let (id, view) = (mesh.entry.id(), self.view(index));
        let pose = config.sets[0].pose(config.seed, &id, view);
        let planned = PlannedView::new(config, &self.patterns, 0, view, pose);
        let request = planned.request(config, &self.patterns, &id);
        let job = request.aim(&placed(config, &mesh.target, mesh.materials.as_ref()));
        Ok(Aimed { mesh, planned, job })
    }

    fn make<T>(
        &self,
        config: &DatasetConfig,
        cast_effects: &Effects,
        Aimed { mesh, planned, job }: &Aimed,
        cast: &Cast,
        make: &impl Fn(&DatasetConfig, Source, Scan) -> Option<T>,
    ) -> Result<(u64, Option<T>), DatasetError> {
        let (set, entry) = (&config.sets[0], &mesh.entry);
        let hits = resolve(job, cast, &self.patterns[0], cast_effects);
        let objects = [ObjectHits::alone(job, &hits, mesh.materials.as_ref())];
        let mut request = planned.request(config, &self.patterns, &entry.id());
        request.effects = Some(config.effects_of(set, self.variant)?);
        request.attributes = config.attributes.clone();
        let (scan, tally) = assemble(&request, cast_effects, &objects)?;
        let source = Source { set, variant: self.variant, entry, view: planned.view };
        Ok((tally.points, make(config, source, scan)))
    }

    /// The mesh of this number, read if it is not in memory.
    fn ready(&self, number: usize) -> Result<Arc<Ready>, DatasetError> {
        let lock = || self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(ready) = lock().get(number) {
            return Ok(ready);
        }
        let (entry, config) = (&self.meshes[number], &self.config);
        let (record, mesh, kept) = read(entry, config.up, config.normalize, Hashing::None)
            .map_err(|error| DatasetError::Mesh(failure(entry, &error)))?;
        let materials = materials(entry, config).map_err(DatasetError::Mesh)?;
        // It is cast at in every epoch.
        let target = Target::new(Surface::new(mesh, kept), Builder::Sah);
        let ready = Arc::new(Ready { entry: record.entry, target, materials });
        lock().put(number, &ready);
        Ok(ready)
    }
}

/// The seed of epoch number `epoch` of a training that has `seed`: that seed itself in epoch 0.
#[must_use]
pub fn seed_of_epoch(seed: u64, epoch: u32) -> u64 {
    if epoch == 0 { seed } else { other_seed(seed, "epoch", epoch) }
}

fn other_seed(seed: u64, purpose: &str, number: u32) -> u64 {
    let [low, high, ..] = StreamKey::new(seed, purpose, number).words([0; 4]);
    u64::from(high) << 32 | u64::from(low)
}

/// One view of one mesh, before it is cast.
struct Aimed {
    mesh: Arc<Ready>,
    planned: PlannedView,
    job: CastJob,
}

/// Meshes that were read, up to some bytes; those that were asked for longest ago leave first.
struct Cache {
    most_bytes: usize,
    bytes: usize,
    clock: u64,
    meshes: HashMap<usize, (u64, Arc<Ready>)>,
}

impl Cache {
    fn new(most_bytes: usize) -> Self {
        Self { most_bytes, bytes: 0, clock: 0, meshes: HashMap::new() }
    }

    fn get(&mut self, number: usize) -> Option<Arc<Ready>> {
        self.clock += 1;
        let (asked, ready) = self.meshes.get_mut(&number)?;
        *asked = self.clock;
        Some(Arc::clone(ready))
    }

    fn put(&mut self, number: usize, ready: &Arc<Ready>) {
        let size = ready.target.bytes();
        if size > self.most_bytes || self.meshes.contains_key(&number) {
            return;
        }
        while self.bytes + size > self.most_bytes {
            let oldest = self.meshes.iter().min_by_key(|(_, (asked, _))| *asked);
            let Some(oldest) = oldest.map(|(&number, _)| number) else { break };
            if let Some((_, leaving)) = self.meshes.remove(&oldest) {
                self.bytes -= leaving.target.bytes();
            }
        }
        self.clock += 1;
        self.bytes += size;
        self.meshes.insert(number, (self.clock, Arc::clone(ready)));
    }
}
