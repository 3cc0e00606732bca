//! Scenes: what stands where, and which sensors look at it.

use super::{Error, Mesh, Sensor};
use crate::effects::Effects;
use crate::pose::{Pose, Trajectory};
use crate::scan::{Glass, PlacedTarget};
use crate::scene::SceneFile;
use edgepuck_mesh::import::{Format, Import};
use edgepuck_mesh::material::Materials;
use formats::plausible::Warning;
use formats::rng::StreamKey;
use formats::scan::{Attribute, AttributeSet};
use glam::{DAffine3, DVec3};
use std::ops::{Index, IndexMut};
use std::path::Path;
use std::sync::Arc;

/// Instances of meshes in the world, and the sensors that look at them.
///
/// A mesh is added once for each place where it stands; the instances share its vertices and its
/// BVH, and moving one rebuilds nothing.
///
/// ```
/// use sim_gpu::{Mesh, Pose, Scene, Sensor};
///
/// # let corners = vec![[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]];
/// # let wall = Mesh::from_triangles(corners, vec![[0, 1, 2]])?;
/// let mut scene = Scene::new();
/// let near = scene.add(&wall, Pose::at([2.0, 0.0, 0.0]));
/// let far = scene.add(&wall, Pose::at([4.0, 0.0, 0.0]));
/// scene[far].scale = [3.0; 3].into();
/// scene[near].reflectivity = 0.4;
///
/// let sensor = Sensor::named("vlp16")?;
/// let both = scene.scan(&sensor, Pose::IDENTITY).run()?;
/// scene[near].pose.position_m.y = 10.0; // it moves aside
/// let after = scene.scan(&sensor, Pose::IDENTITY).run()?;
/// assert!(both.object.as_ref().is_some_and(|objects| objects.contains(&near.number())));
/// assert!(after.object.as_ref().is_some_and(|objects| objects.contains(&far.number())));
/// # Ok::<(), sim_gpu::Error>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Scene {
    /// The sensors that [`Scene::scan_all`] scans with.
    pub sensors: Vec<MountedSensor>,
    /// The effects of all scans that do not name their own; none by default.
    pub effects: Effects,
    /// What points carry besides their positions; by default range, beam, ring, time and object.
    pub attributes: AttributeSet,
    /// Seed of all random numbers; 0 by default.
    pub seed: u64,
    instances: Vec<Instance>,
    /// What is probably wrong with the trajectories of its file.
    pub(super) warnings: Vec<Warning>,
}

/// The handle of an [`Instance`] of a [`Scene`]: `scene[id]` is the instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(u32);

/// A mesh at a place in a scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Instance {
    /// The mesh.
    pub mesh: Mesh,
    /// Where it stands, metres.
    pub pose: Pose,
    /// Factors along the axes of the mesh, all above 0; 1 by default.
    pub scale: DVec3,
    /// If it moves: the poses over time of the frame in which it stands at `pose`.
    pub motion: Option<Arc<Trajectory>>,
    /// A name. It keys the random numbers of the instance's returns.
    pub name: Option<String>,
    /// The name of its class.
    pub label: Option<String>,
    /// The part of the light that comes back at vertical incidence, 0 to 1; 1 by default.
    pub reflectivity: f64,
    /// How well it returns light to where it came from, 0 to 1, 1 being an ideal retro-reflector;
    /// 0 by default.
    pub retroreflection: f64,
    /// Which of its triangles are glass; nothing by default.
    pub glass: Option<Glass>,
    /// The materials of its faces, in place of its reflectivity; one for all by default.
    pub materials: Option<Arc<Materials>>,
}

/// A sensor at a place in a scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MountedSensor {
    /// Its name, which keys the random numbers of its scans.
    pub name: String,
    /// The sensor.
    pub sensor: Sensor,
    /// Where it stands; if it moves, when the scan begins.
    pub pose: Pose,
    /// Its poses over time, if it moves.
    pub motion: Option<Arc<Trajectory>>,
    /// The time of all trajectories at which its scan begins, seconds; 0 by default.
    pub start_s: f64,
    /// Whether the points of a moving sensor are where its beams met the surfaces. By default they
    /// are motion-distorted, as a driver that ignores ego-motion reports them.
    pub deskew: bool,
}

impl Scene {
    /// A scene without instances and sensors.
    #[must_use]
    pub fn new() -> Self {
        let attributes = [
            Attribute::Range,
            Attribute::Beam,
            Attribute::Ring,
            Attribute::Time,
            Attribute::Object,
        ];
        Self {
            sensors: Vec::new(),
            effects: Effects::default(),
            attributes: attributes.into(),
            seed: 0,
            instances: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Reads a scene's TOML file, and the meshes and sensor profiles that it names; or a glTF file or a
    /// robot, as [`Scene::add_file`] does.
    ///
    /// # Errors
    /// With the file, the key, line or node, and the cause.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        if Format::from_path(path.as_ref()).is_some() {
            let mut scene = Self::new();
            scene.add_file(path, &Import::default())?;
            return Ok(scene);
        }
        Self::try_from(&SceneFile::load(path.as_ref())?)
    }

    /// Adds an instance of `mesh` at `pose`. Set its other properties through the handle:
    /// `scene[id].reflectivity = 0.3`.
    pub fn add(&mut self, mesh: impl Into<Mesh>, pose: Pose) -> InstanceId {
        let id = InstanceId(self.instances.len() as u32);
        self.instances.push(Instance::new(mesh.into(), pose));
        id
    }

    /// Adds a sensor of this name at `pose`. Set its other properties through the reference:
    /// `scene.mount("left", &sensor, pose).deskew = true`.
    pub fn mount(&mut self, name: &str, sensor: &Sensor, pose: Pose) -> &mut MountedSensor {
        let (name, sensor) = (name.to_owned(), sensor.clone());
        let (motion, start_s, deskew) = (None, 0.0, false);
        let mounted = MountedSensor { name, sensor, pose, motion, start_s, deskew };
        self.sensors.push(mounted);
        self.sensors.last_mut().expect("invariant: it was just added")
    }

    /// The instances, each at the number that its [`InstanceId`] and the scans' attribute `object`
    /// have.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The names of the instances for those who read scans, each that of the instance, or its label or
    /// number; and their labels, or empty texts. Both are empty if no instance has one.
    #[must_use]
    pub fn object_texts(&self) -> [Vec<String>; 2] {
        let all = || self.instances.iter().enumerate();
        let line = |text: String| text.replace(['\n', '\r'], " ");
        let label = |(_, of): (_, &Instance)| line(of.label.clone().unwrap_or_default());
        let name = |(i, of): (usize, &Instance)| {
            let known = of.name.clone().or_else(|| of.label.clone());
            line(known.unwrap_or_else(|| i.to_string()))
        };
        let has_labels = all().any(|(_, of)| of.label.is_some());
        let has_names = has_labels || all().any(|(_, of)| of.name.is_some());
        [
            all().filter(|_| has_names).map(name).collect(),
            all().filter(|_| has_labels).map(label).collect(),
        ]
    }

    /// What is probably wrong with the files of its meshes, each warning once with the file, and with
    /// the trajectories of its file.
    #[must_use]
    pub fn warnings(&self) -> Vec<&Warning> {
        let all = self.instances.iter().flat_map(|instance| instance.mesh.warnings());
        let mut found: Vec<&Warning> = Vec::new();
        for warning in all.chain(&self.warnings) {
            if !found.contains(&warning) {
                found.push(warning);
            }
        }
        found
    }

    /// The handles of the instances, in their order.
    pub fn ids(&self) -> impl Iterator<Item = InstanceId> + use<> {
        (0..self.instances.len() as u32).map(InstanceId)
    }

    /// The handle of the instance with this number, if there is one.
    #[doc(hidden)]
    #[must_use]
    pub fn id(&self, number: u32) -> Option<InstanceId> {
        ((number as usize) < self.instances.len()).then_some(InstanceId(number))
    }

    /// All instances as a caster takes them. `stream` gives the key of an instance's random numbers by
    /// its name and number; `None` is that of the scan.
    #[doc(hidden)]
    pub fn placed(
        &self,
        stream: impl Fn(Option<&str>, u32) -> Option<StreamKey>,
    ) -> Vec<PlacedTarget<'_>> {
        self.placed_at(|_| None, stream)
    }

    /// As [`placed`](Self::placed), with those instances that `pose` names by their numbers elsewhere.
    pub(super) fn placed_at(
        &self,
        pose: impl Fn(u32) -> Option<Pose>,
        stream: impl Fn(Option<&str>, u32) -> Option<StreamKey>,
    ) -> Vec<PlacedTarget<'_>> {
        let numbered = self.instances.iter().zip(0..);
        numbered
            .map(|(instance, number)| {
                let mut placed = instance.placed_at(pose(number).unwrap_or(instance.pose));
                placed.stream = stream(instance.name.as_deref(), number);
                placed
            })
            .collect()
    }
}

impl Default for Scene {
    fn default() -> Self {
        Self::new()
    }
}

impl InstanceId {
    /// Its number, which the attribute `object` of scans holds.
    #[must_use]
    pub fn number(self) -> u32 {
        self.0
    }
}

impl Index<InstanceId> for Scene {
    type Output = Instance;

    fn index(&self, id: InstanceId) -> &Instance {
        &self.instances[id.0 as usize]
    }
}

impl IndexMut<InstanceId> for Scene {
    fn index_mut(&mut self, id: InstanceId) -> &mut Instance {
        &mut self.instances[id.0 as usize]
    }
}

impl Instance {
    fn new(mesh: Mesh, pose: Pose) -> Self {
        Self {
            mesh,
            pose,
            scale: DVec3::ONE,
            motion: None,
            name: None,
            label: None,
            reflectivity: 1.0,
            retroreflection: 0.0,
            glass: None,
            materials: None,
        }
    }

    /// As a caster takes it, at `pose`.
    fn placed_at(&self, pose: Pose) -> PlacedTarget<'_> {
        let Pose { position_m, rotation } = pose;
        let world_from_mesh =
            DAffine3::from_scale_rotation_translation(self.scale, rotation, position_m);
        let mut placed = PlacedTarget::new(self.mesh.target());
        placed.world_from_object = world_from_mesh * *self.mesh.mesh_from_target();
        placed.motion.clone_from(&self.motion);
        placed.reflectivity = self.reflectivity as f32;
        placed.retroreflection = self.retroreflection;
        placed.glass.clone_from(&self.glass);
        placed.materials = self.materials.as_deref();
        placed
    }
}
