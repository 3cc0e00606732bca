//! What all scenes of a recipe share: sensors with their casters, and models of objects.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use formats::plausible::Warning;
use formats::streams::Stream;
use glam::{DQuat, DVec3};
use sim_gpu::effects::{Effects, Intensity, Noise};
use sim_gpu::errors::{ConfigError, InvalidValue};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::sensors::SensorProfile;
use sim_gpu::{Caster, Glass, InstanceId, Mesh, Pose, Scene, Sensor};

use crate::error::SceneError;
use crate::model::{Model, UserFiles, user_models};
use crate::placed_object::PlacedObject;
use crate::recipe::Recipe;

/// A recipe with everything that is needed to draw and scan its scenes.
pub struct Stage {
    recipe: Recipe,
    seed: u64,
    classes: Vec<String>,
    pub(crate) sensors: Vec<StageSensor>,
    /// By entry of the recipe and by variant; built-in models are built when first used.
    models: Vec<Vec<OnceLock<Model>>>,
    user_files: UserFiles,
}

pub(crate) struct StageSensor {
    pub(crate) sensor: Sensor,
    pub(crate) caster: Arc<OpenCaster>,
}

impl Stage {
    /// Prepares `recipe` with casters on the CPU; see [`Stage::with_caster`].
    ///
    /// # Errors
    /// A sensor profile or a mesh is missing or invalid.
    pub fn new(
        recipe: Recipe,
        file: &Path,
        meshes: Option<&Path>,
        seed: u64,
    ) -> Result<Self, SceneError> {
        Self::with_caster(recipe, file, meshes, seed, &Caster::cpu())
    }

    /// Prepares `recipe`, which was read from `file`. `meshes` is the folder with the user's
    /// meshes, `seed` the seed of all random numbers.
    ///
    /// # Errors
    /// A sensor profile or a mesh is missing or invalid, or the adapter does not open.
    pub fn with_caster(
        recipe: Recipe,
        file: &Path,
        meshes: Option<&Path>,
        seed: u64,
        caster: &Caster,
    ) -> Result<Self, SceneError> {
        if let Some(folder) = meshes
            && recipe.object.iter().all(|objects| objects.built_in().is_some())
        {
            return Err(SceneError::UnusedMeshes(folder.to_path_buf()));
        }
        let profiles = recipe.sensors(file)?;
        let mut sensors = Vec::with_capacity(profiles.len());
        for (choice, profile) in recipe.sensor.iter().zip(profiles) {
            let typical_m = profile.noise.map_or(0.0, |noise| noise.sigma_m());
            let effects = Effects {
                noise: choice.effects.noise.or(Some(Noise::along_range(typical_m))),
                intensity: Some(Intensity),
                ..choice.effects.clone()
            };
            let in_file =
                |invalid: InvalidValue| SceneError::from(ConfigError::value(file, invalid));
            effects.for_sensor(&profile).map_err(in_file)?;
            let sensor = Sensor::from(profile);
            sensor.rays(&effects).map_err(in_file)?;
            sensors.push(StageSensor { sensor, caster: caster.for_effects(&effects)? });
        }
        let mut user_files = UserFiles::default();
        user_files.warnings.extend(sensors.iter().flat_map(|it| it.sensor.profile().warnings()));
        let models = recipe.object.iter().map(|objects| match objects.built_in() {
            Some(_) => Ok((0..recipe.variants).map(|_| OnceLock::new()).collect()),
            None => user_models(objects, meshes, seed, &mut user_files),
        });
        let models = models.collect::<Result<_, SceneError>>()?;
        let classes = recipe.classes();
        Ok(Self { classes, recipe, seed, sensors, models, user_files })
    }

    /// What is probably wrong with the sensors and with the files of the user's meshes.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.user_files.warnings
    }

    /// The files of the user's meshes, in the order in which they are read.
    #[must_use]
    pub fn mesh_files(&self) -> &[PathBuf] {
        &self.user_files.files
    }

    /// The recipe.
    #[must_use]
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// The profiles of the recipe's sensors.
    pub fn profiles(&self) -> impl Iterator<Item = &SensorProfile> {
        self.sensors.iter().map(|sensor| sensor.sensor.profile())
    }

    /// The seed of all random numbers.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The classes of [`Recipe::classes`].
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// The number of models of an entry of the recipe.
    pub(crate) fn variants(&self, entry: usize) -> u32 {
        self.models[entry].len() as u32
    }

    pub(crate) fn model(&self, entry: usize, variant: u32) -> &Model {
        let model = &self.models[entry][variant as usize];
        model.get().unwrap_or_else(|| {
            let kind = self.recipe.object[entry].built_in();
            let kind = kind.expect("invariant: the models of users' meshes exist from the start");
            // Outside of `get_or_init`: building a tree may run another task of the pool, which may
            // want the same model.
            let built = Model::built_in(kind, self.seed, variant);
            model.get_or_init(|| built)
        })
    }

    /// The length, width and height of `object`, metres.
    pub(crate) fn size_of(&self, object: &PlacedObject) -> DVec3 {
        self.model(object.entry, object.variant).size_m * object.scale
    }

    /// Adds the ground of the scene or drive number `number`, or a tile of it, to `world`.
    pub(crate) fn add_ground(&self, world: &mut Scene, mesh: &Mesh, number: u32) {
        let id = world.add(mesh, Pose::IDENTITY);
        let drawn = Stream::GroundReflectivity { scene: number }.key(self.seed).unit(0);
        world[id].reflectivity = self.recipe.ground.reflectivity.at(drawn);
    }

    /// Adds `object` to `world`, with its class, its reflectivity and its glass, which returns the
    /// fraction `glass_returned` of the beams.
    pub(crate) fn add_object(
        &self,
        world: &mut Scene,
        object: &PlacedObject,
        glass_returned: f64,
    ) -> InstanceId {
        let (model, entry) =
            (self.model(object.entry, object.variant), &self.recipe.object[object.entry]);
        let rotation = DQuat::from_rotation_z(object.yaw_rad);
        let id = world.add(&model.mesh, Pose { position_m: object.position, rotation });
        let instance = &mut world[id];
        instance.scale = object.scale;
        instance.label = Some(entry.class.clone());
        let drawn = Stream::ObjectReflectivity { entry: object.entry as u32 }.key(self.seed);
        instance.reflectivity = entry.reflectivity.at(drawn.unit(object.variant.into()));
        instance.glass = (!model.glass.is_empty())
            .then(|| Glass { triangles: model.glass.clone(), returned: glass_returned });
        id
    }
}
