//! One view of one mesh: the scan that a dataset asks for, aimed before the rays are cast and
//! assembled after.

use crate::config::{DatasetConfig, SetConfig, Variant};
use formats::Scan;
use formats::vlp32c::Revolution;
use glam::DVec3;
use sim_gpu::Pose;
use sim_gpu::Tally;
use sim_gpu::effects::Effects;
use sim_gpu::errors::InvalidValue;
use sim_gpu::internals::job::{Cast, CastJob};
use sim_gpu::internals::resolve::{Hits, resolve};
use sim_gpu::internals::scan::{ObjectHits, PlacedTarget, ScanRequest, assemble};
use sim_gpu::internals::target::Target;
use sim_gpu::packets;
use sim_gpu::sensors::BeamPattern;
use sim_gpu::{Mesh, Scene};
use std::slice::from_ref;
use std::sync::Arc;

/// What all views of a dataset share.
#[derive(Clone, Copy)]
pub(crate) struct Rig<'a> {
    pub config: &'a DatasetConfig,
    pub patterns: &'a [Arc<BeamPattern>],
    pub cast_effects: &'a Effects,
}

pub(crate) struct View<'a> {
    pub set: &'a SetConfig,
    /// The number of the view in its set.
    pub number: u32,
    rig: Rig<'a>,
    request: ScanRequest<'a>,
}

/// The scene of a mesh: one instance, whose `target` is moved to `centre`.
pub(crate) fn scene(config: &DatasetConfig, target: Target, centre: DVec3) -> Scene {
    let mut scene = Scene::new();
    let id = scene.add(Mesh::from_target(target, centre), Pose::IDENTITY);
    scene[id].reflectivity = config.reflectivity;
    scene
}

/// The only instance of `scene`, whose random numbers are those of each view.
pub(crate) fn placed(scene: &Scene) -> PlacedTarget<'_> {
    let placed = scene.placed(|_, _| None).pop();
    placed.expect("invariant: a dataset's scene has one instance")
}

/// The beams of each set's sensor, widened to the footprint that the effects ask for.
pub(crate) fn patterns(config: &DatasetConfig) -> Result<Vec<Arc<BeamPattern>>, InvalidValue> {
    config.sets.iter().map(|set| set.sensor.rays(&config.effects)).collect()
}

impl<'a> Rig<'a> {
    /// All views of the mesh `id`, which stands around `centre`: by set, then by number.
    pub fn views(self, id: &str, centre: DVec3) -> Vec<View<'a>> {
        let views_of_set = |set: usize| {
            let poses = self.config.sets[set].poses(self.config.seed, id, centre);
            poses.into_iter().zip(0..).map(move |(pose, number)| self.view(set, number, pose, id))
        };
        (0..self.config.sets.len()).flat_map(views_of_set).collect()
    }

    /// View `number` of set number `set` of the mesh `id`, from `pose`.
    pub fn view(self, set: usize, number: u32, pose: Pose, id: &str) -> View<'a> {
        let Self { config, patterns, .. } = self;
        let (set, pattern) = (&config.sets[set], &patterns[set]);
        let mut request = ScanRequest::new(set.sensor.profile(), pattern, pose);
        let trajectory = config.effects.motion.as_deref();
        let trajectory = trajectory.map(|motion| motion.trajectory(pose, [0.0, pattern.last_s()]));
        request.motion = trajectory.map(Arc::new);
        request.stream = set.stream(config.seed, id, number);
        request.attributes = config.attributes.clone();
        View { set, number, rig: self, request }
    }
}

impl View<'_> {
    pub fn pattern(&self) -> &BeamPattern {
        self.request.pattern
    }

    pub fn pose(&self) -> &Pose {
        &self.request.pose
    }

    /// The rays to cast at the mesh.
    pub fn aim(&self, placed: &PlacedTarget) -> CastJob {
        self.request.aim(placed)
    }

    /// Where the rays of `job` meet the mesh, from the answers of the caster.
    pub fn resolve(&self, job: &CastJob, cast: &Cast) -> Hits {
        resolve(job, cast, self.pattern(), self.rig.cast_effects)
    }

    pub fn scan(&self, variant: Variant, hits: &ObjectHits) -> Result<(Scan, Tally), InvalidValue> {
        assemble(&self.request_of(variant)?, self.rig.cast_effects, from_ref(hits))
    }

    /// The scan with the attributes that packets hold, and the revolution of the sensor.
    pub fn packets(
        &self,
        variant: Variant,
        hits: &ObjectHits,
    ) -> Result<(Scan, Revolution), InvalidValue> {
        let revolution = packets::revolution(self.set.sensor.profile())?;
        let mut request = self.request_of(variant)?;
        let effects = request.applied_effects(self.rig.cast_effects)?;
        request.attributes = packets::attributes(&effects, &request.attributes);
        let (scan, _) = assemble(&request, self.rig.cast_effects, from_ref(hits))?;
        Ok((scan, revolution))
    }

    fn request_of(&self, variant: Variant) -> Result<ScanRequest<'_>, InvalidValue> {
        let mut request = self.request.clone();
        request.effects = Some(self.rig.config.effects_of(self.set, variant)?);
        Ok(request)
    }
}
