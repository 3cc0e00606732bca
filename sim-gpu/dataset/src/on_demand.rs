use crate::clouds::{Points, Source, draw, draw_rows};
use crate::config::{DatasetConfig, Variant, Viewpoints};
use crate::error::DatasetError;
use crate::mesh::{frame, plausibility, read, warnings};
use crate::record::Entry;
use crate::settings::MOST_VIEWS;
use crate::view::{self, Rig, View, patterns};
use edgepuck_mesh::tree::MeshEntry;
use formats::hash::Hashing;
use formats::scan::Attribute;
use formats::streams::Stream;
use formats::{Scan, Split};
use glam::DVec3;
use rayon::prelude::*;
use sim_gpu::errors::InvalidValue;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::job::CastJob;
use sim_gpu::internals::scan::ObjectHits;
use sim_gpu::internals::target::Target;
use sim_gpu::sensors::BeamPattern;
use sim_gpu::{Caster, Scene};
use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

/// Views of a mesh that are tried until one has enough points.
const ATTEMPTS: u32 = 8;

/// The clouds of a dataset, cast on demand: cloud `i` is view `i % views` of mesh `i / views`.
///
/// They are the clouds that [`make`](crate::make()) packs for the same settings, bit by bit, but
/// nothing is written, and another seed gives other views of the same meshes.
pub struct Clouds {
    config: DatasetConfig,
    variant: Variant,
    meshes: Vec<MeshEntry>,
    classes: Vec<String>,
    patterns: Vec<Arc<BeamPattern>>,
    cache: Mutex<Cache>,
    warnings: Mutex<Warnings>,
}

/// Warnings about the meshes: all of them, and those that no call returned yet.
type Warnings = (BTreeSet<String>, Vec<String>);

/// A mesh in memory.
struct Ready {
    entry: Entry,
    /// What the viewpoints stand around, metres.
    centre: DVec3,
    scene: Scene,
}

impl Ready {
    /// Bytes of the mesh and its BVH.
    fn bytes(&self) -> usize {
        self.scene.instances().iter().map(|instance| instance.mesh.target().bytes()).sum()
    }
}

impl Clouds {
    /// The clouds of the meshes of `split`, or of all meshes, for the only set of `config`: noisy
    /// clouds if it has the noisy variant. `meshes` are all meshes of the dataset, sorted by class,
    /// since labels are indices into their classes. Up to `cache_bytes` of meshes stay in memory.
    ///
    /// # Errors
    /// If there is not exactly one set, if there are too many views, or if the effects do not
    /// fit the sensor.
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
        if let Viewpoints::Views(views) = &set.viewpoints {
            views.validate()?;
        }
        config.check_views()?;
        config.effects.for_sensor(set.sensor.profile())?;
        let patterns = patterns(&config)?;
        let variant =
            if config.variants.contains(&Variant::Noisy) { Variant::Noisy } else { Variant::Clean };
        let cache = Mutex::new(Cache::new(cache_bytes));
        let config = DatasetConfig { hash: Hashing::None, ..config };
        let mut classes: Vec<String> = meshes.iter().map(|mesh| mesh.class.clone()).collect();
        classes.dedup();
        let is_wanted = |mesh: &&MeshEntry| split.is_none_or(|split| mesh.split == split);
        let meshes = meshes.iter().filter(is_wanted).cloned().collect();
        let warnings = Mutex::default();
        Ok(Self { config, variant, meshes, classes, patterns, cache, warnings })
    }

    /// The number of clouds.
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

    /// The mesh of cloud `index`.
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

    /// The settings of the dataset.
    #[must_use]
    pub fn config(&self) -> &DatasetConfig {
        &self.config
    }

    /// The number of the view of cloud `index`.
    #[must_use]
    pub fn view(&self, index: usize) -> u32 {
        (index % self.views()) as u32
    }

    /// The clouds at `indices`, with the random numbers of `seed`, as rows of numbers: each point, in
    /// the unit sphere, and its `attributes`, which the settings must have and which keep the units
    /// that they have in scans. A view that has too few points for a cloud is replaced by a view of
    /// another seed.
    ///
    /// # Errors
    /// A mesh that cannot be read, or none of whose views has enough points; an adapter that fails.
    pub fn draw(
        &self,
        caster: &Caster,
        seed: u64,
        indices: &[usize],
        attributes: &[Attribute],
    ) -> Result<Vec<Vec<f32>>, DatasetError> {
        let drawn = self.make_each(caster, seed, indices, |config, source, scan| {
            draw_rows(config, source, &scan, attributes)
        })?;
        drawn.into_iter().collect()
    }

    /// Warnings about the meshes that were drawn, which no call returned before.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut warnings.1)
    }

    /// The points of [`Clouds::draw`], with a result for each cloud.
    ///
    /// # Errors
    /// An adapter that fails.
    pub fn draw_each(
        &self,
        caster: &Caster,
        seed: u64,
        indices: &[usize],
    ) -> Result<Vec<Result<Points, DatasetError>>, DatasetError> {
        self.make_each(caster, seed, indices, |config, source, scan| draw(config, source, &scan))
    }

    /// The scans of those clouds, with a result for each.
    ///
    /// # Errors
    /// An adapter that fails.
    pub fn scan_each(
        &self,
        caster: &Caster,
        seed: u64,
        indices: &[usize],
    ) -> Result<Vec<Result<Scan, DatasetError>>, DatasetError> {
        self.make_each(caster, seed, indices, |config, _, scan| {
            (scan.len() as u64 >= u64::from(config.min_points)).then_some(scan)
        })
    }

    /// The results of `make` for the scan of each view. If it returns `None`, another view takes
    /// the place of that one.
    fn make_each<T: Send>(
        &self,
        caster: &Caster,
        seed: u64,
        indices: &[usize],
        make: impl Fn(&DatasetConfig, Source, Scan) -> Option<T> + Sync,
    ) -> Result<Vec<Result<T, DatasetError>>, DatasetError> {
        let mut made = self.cast(caster, seed, indices, &make)?;
        for attempt in 1..ATTEMPTS {
            let is_sparse = |&i: &usize| matches!(made[i], Err(DatasetError::Sparse { .. }));
            let sparse: Vec<usize> = (0..made.len()).filter(is_sparse).collect();
            if sparse.is_empty() {
                break;
            }
            let indices: Vec<usize> = sparse.iter().map(|&i| indices[i]).collect();
            let other_seed = Stream::AnotherView { attempt }.key(seed).seed();
            let others = self.cast(caster, other_seed, &indices, &make)?;
            for (i, mut other) in sparse.into_iter().zip(others) {
                use DatasetError::Sparse;
                if let (Err(Sparse { most, tried, .. }), Err(Sparse { most: before, .. })) =
                    (&mut other, &made[i])
                {
                    (*most, *tried) = ((*most).max(*before), attempt + 1);
                }
                made[i] = other;
            }
        }
        Ok(made)
    }

    fn views(&self) -> usize {
        self.config.sets[0].viewpoints.count()
    }

    /// The results of `make` for some views, which are cast together. If it returns `None`, the
    /// result is [`DatasetError::Sparse`].
    fn cast<T: Send>(
        &self,
        caster: &Caster,
        seed: u64,
        indices: &[usize],
        make: &(impl Fn(&DatasetConfig, Source, Scan) -> Option<T> + Sync),
    ) -> Result<Vec<Result<T, DatasetError>>, DatasetError> {
        let config = &DatasetConfig { seed, ..self.config.clone() };
        let caster = caster.for_effects(&self.config.cast_effects())?;
        let (patterns, cast_effects) = (&self.patterns, caster.effects());
        let rig = Rig { config, patterns, cast_effects };
        let aimed: Vec<Result<Aimed, DatasetError>> =
            indices.par_iter().map(|&index| self.aim(rig, index)).collect();
        let jobs: Vec<CastJob> = aimed.iter().flatten().map(|aimed| aimed.job.clone()).collect();
        let fits = jobs.iter().all(|job| caster.fits(&job.target));
        let casts = if fits { caster.cast(&jobs)? } else { caster.cast_on_cpu(&jobs) };
        let mut casts = casts.into_iter();
        let cast: Vec<_> = aimed
            .into_iter()
            .map(|aimed| aimed.map(|aimed| (aimed, casts.next().unwrap_or_default())))
            .collect();
        let made = cast.into_par_iter().zip(indices).map(|(cast, &index)| {
            let (Aimed { mesh, view, job }, cast) = cast?;
            let hits = view.resolve(&job, &cast);
            let placed = view::placed(&mesh.scene);
            let hits = ObjectHits::new(0, &placed, &job, &hits);
            let (scan, tally) = view.scan(self.variant, &hits)?;
            let (set, variant, entry) = (view.set, self.variant, &mesh.entry);
            let source = Source { set, variant, entry, view: view.number };
            make(config, source, scan).ok_or_else(|| DatasetError::Sparse {
                source_file: self.mesh(index).relative.clone(),
                least: config.min_points,
                most: tally.points,
                tried: 1,
            })
        });
        Ok(made.collect())
    }

    fn aim<'a>(&self, rig: Rig<'a>, index: usize) -> Result<Aimed<'a>, DatasetError> {
        let mesh = self.ready(index / self.views())?;
        let (id, number) = (mesh.entry.id(), self.view(index));
        let pose = rig.config.sets[0].pose(rig.config.seed, &id, mesh.centre, number);
        let view = rig.view(0, number, pose, &id);
        let job = view.aim(&view::placed(&mesh.scene));
        Ok(Aimed { mesh, view, job })
    }

    /// Mesh `number`, which is read unless it is in memory.
    fn ready(&self, number: usize) -> Result<Arc<Ready>, DatasetError> {
        let lock = || self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(ready) = lock().get(number) {
            return Ok(ready);
        }
        let (entry, config) = (&self.meshes[number], &self.config);
        let loaded = read(entry, Hashing::None)?;
        let (record, surface) = frame(entry, loaded, config.up, config.units, config.normalize)?;
        let mut found: Vec<String> = warnings(&record).collect();
        // Rays are cast at it in every epoch, which pays for the better tree.
        let target = Target::new(surface, Builder::Sah);
        let centre = DVec3::from_array(record.views_around);
        let scene = view::scene(config, target, centre);
        // Tars have any number of views, more than memory can hold.
        let (id, first_views) = (record.entry.id(), 0..self.views().min(MOST_VIEWS) as u32);
        let pose = |view| config.sets[0].pose(config.seed, &id, centre, view);
        let sensors_m: Vec<DVec3> = first_views.map(|view| pose(view).position_m).collect();
        found.extend(plausibility(&record.source, config, &scene, &sensors_m));
        let (known, new) = &mut *self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        new.extend(found.into_iter().filter(|warning| known.insert(warning.clone())));
        let ready = Arc::new(Ready { entry: record.entry, centre, scene });
        lock().put(number, &ready);
        Ok(ready)
    }
}

/// The seed of epoch `epoch` of a training that has `seed`, which is the seed of epoch 0.
#[must_use]
pub fn seed_of_epoch(seed: u64, epoch: u32) -> u64 {
    if epoch == 0 { seed } else { Stream::Epoch { epoch }.key(seed).seed() }
}

/// One view of one mesh, before its rays are cast.
struct Aimed<'a> {
    mesh: Arc<Ready>,
    view: View<'a>,
    job: CastJob,
}

/// Meshes in memory, up to `most_bytes`. The least recently used mesh leaves first.
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
        let (used_at, ready) = self.meshes.get_mut(&number)?;
        *used_at = self.clock;
        Some(Arc::clone(ready))
    }

    fn put(&mut self, number: usize, ready: &Arc<Ready>) {
        let size = ready.bytes();
        if size > self.most_bytes || self.meshes.contains_key(&number) {
            return;
        }
        while self.bytes + size > self.most_bytes {
            let oldest = self.meshes.iter().min_by_key(|(_, (used_at, _))| *used_at);
            let Some(oldest) = oldest.map(|(&number, _)| number) else { break };
            if let Some((_, leaving)) = self.meshes.remove(&oldest) {
                self.bytes -= leaving.bytes();
            }
        }
        self.clock += 1;
        self.bytes += size;
        self.meshes.insert(number, (self.clock, Arc::clone(ready)));
    }
}
