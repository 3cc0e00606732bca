//! What all scenes of a recipe share: sensors, casters, and the objects, each of
//! which is built once and placed many times.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use edgepuck_shapes::objects::{Object, ObjectKind, object, stand};
use formats::Scan;
use formats::rng::StreamKey;
use formats::scan::Attribute;
use glam::DVec3;
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::config::InvalidValue;
use sim_gpu::effects::{Dropout, Effects, Noise, NoiseModel};
use sim_gpu::job::Culling;
use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::unit_frame::bounding_box;
use sim_gpu::mesh::{self, Mesh, MeshFormat};
use sim_gpu::scan::{Glass, PlacedTarget, ScanRequest, scan_objects};
use sim_gpu::sensor::{BeamPattern, Sensor};
use sim_gpu::target::{Surface, Target};

use crate::error::SceneError;
use crate::recipe::{Objects, Recipe};
use crate::scene::{PlacedObject, Scene};

/// A recipe, ready to be drawn from and scanned.
pub struct Stage {
    recipe: Recipe,
    seed: u64,
    classes: Vec<String>,
    pub(crate) sensors: Vec<Eye>,
    culling: Culling,
    /// By entry of the recipe and by variant.
    props: Vec<Vec<OnceLock<Prop>>>,
}

/// A sensor and how its beams are cast.
pub(crate) struct Eye {
    pub(crate) sensor: Sensor,
    pattern: BeamPattern,
    pub(crate) caster: Caster,
}

/// An object, ready to be cast.
pub(crate) struct Prop {
    target: Target,
    glass: Range<u32>,
    /// Length, width and height.
    pub(crate) size_m: DVec3,
}

/// One revolution of a sensor in a scene.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The points in the order of firing, in the sensor's frame, metres, with range,
    /// beam, ring, time and object. Object 0 is the ground, and `i` the scene's
    /// object `i - 1`.
    pub scan: Scan,
}

impl Stage {
    /// Prepares `recipe`, which stands in `file`. Meshes of a user's own are taken
    /// from `meshes`. `open` opens a caster for the effects of each sensor.
    ///
    /// # Errors
    /// A sensor that is missing or wrong; meshes that are missing or cannot be
    /// read; what `open` reports.
    pub fn new<E: From<SceneError>>(
        recipe: Recipe,
        file: &Path,
        meshes: Option<&Path>,
        seed: u64,
        open: impl Fn(&Effects) -> Result<Caster, E>,
    ) -> Result<Self, E> {
        let profiles = recipe.sensors(file).map_err(SceneError::from)?;
        let mut sensors = Vec::with_capacity(profiles.len());
        for (choice, sensor) in recipe.sensor.iter().zip(profiles) {
            let typical_m = sensor.noise.map_or(0.0, |noise| noise.typical_sigma_m);
            let sigma_m = choice.noise_m.unwrap_or(typical_m);
            let effects = Effects {
                noise: Some(Noise { mean_m: 0.0, sigma_m, model: NoiseModel::Range }),
                dropout: Some(Dropout { probability: choice.dropout }),
                ..choice.effects.clone()
            };
            let in_file = |invalid: InvalidValue| SceneError::from(invalid.in_file(file));
            effects.for_sensor(&sensor).map_err(in_file)?;
            let pattern = effects.widen(sensor.pattern(), &sensor).map_err(in_file)?;
            sensors.push(Eye { sensor, pattern, caster: open(&effects)? });
        }
        let props = recipe.object.iter().map(|objects| match objects.built_in() {
            Some(_) => Ok((0..recipe.variants).map(|_| OnceLock::new()).collect()),
            None => own_meshes(objects, meshes, seed),
        });
        let props = props.collect::<Result<_, SceneError>>()?;
        Ok(Self { classes: recipe.classes(), recipe, seed, sensors, culling: Culling::On, props })
    }

    /// The same stage, whose beams that cannot hit anything are cast as `culling` says; the
    /// sweeps are the same.
    #[must_use]
    pub fn with_culling(self, culling: Culling) -> Self {
        Self { culling, ..self }
    }

    /// The recipe.
    #[must_use]
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Seed of all random numbers.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// As [`Recipe::classes`].
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// The sensor of `scene`.
    #[must_use]
    pub fn sensor(&self, scene: &Scene) -> &Sensor {
        &self.sensors[scene.sensor].sensor
    }

    /// Length, width and height of object `i` of `scene`, metres.
    #[must_use]
    pub fn size_m(&self, scene: &Scene, i: usize) -> DVec3 {
        self.size_of(&scene.objects[i])
    }

    /// Length, width and height of `object`, metres.
    pub(crate) fn size_of(&self, object: &PlacedObject) -> DVec3 {
        self.prop(object.entry, object.variant).size_m * object.scale
    }

    /// How many objects entry `entry` of the recipe has to choose from.
    pub(crate) fn variants(&self, entry: usize) -> u32 {
        self.props[entry].len() as u32
    }

    /// Object number `variant` of entry `entry`.
    pub(crate) fn prop(&self, entry: usize, variant: u32) -> &Prop {
        self.props[entry][variant as usize].get_or_init(|| {
            let kind = self.recipe.object[entry].built_in();
            let kind = kind.expect("invariant: a user's meshes are made ready at the start");
            Prop::built_in(kind, self.seed, variant)
        })
    }

    /// Scans `scene`: its ground and all its objects together.
    ///
    /// # Errors
    /// If the adapter fails.
    pub fn sweep(&self, scene: &Scene) -> Result<Sweep, SceneError> {
        let ground = Target::new(whole(scene.ground.mesh()), Builder::Morton);
        let mut targets = vec![self.ground(&ground, scene.number)];
        targets
            .extend(scene.objects.iter().map(|object| self.target(object, scene.glass_returned)));
        self.sweep_targets(scene, &mut targets)
    }

    /// A part of the ground of the scene or drive of this `number`.
    pub(crate) fn ground<'a>(&self, part: &'a Target, number: u32) -> PlacedTarget<'a> {
        let drawn = StreamKey::new(self.seed, "reflectivity/ground", number).unit(0);
        let mut placed = PlacedTarget::new(part);
        placed.reflectivity = self.recipe.ground.reflectivity.at(drawn) as f32;
        placed
    }

    /// `object` where it stands, whose glass returns this part of the beams.
    pub(crate) fn target(&self, object: &PlacedObject, glass_returned: f64) -> PlacedTarget<'_> {
        let prop = self.prop(object.entry, object.variant);
        let mut placed = PlacedTarget::new(&prop.target);
        placed.world_from_object = object.world_from_object();
        let drawn = StreamKey::new(self.seed, "reflectivity/object", object.entry as u32);
        let reflectivity = self.recipe.object[object.entry].reflectivity;
        placed.reflectivity = reflectivity.at(drawn.unit(object.variant.into())) as f32;
        placed.glass = (!prop.glass.is_empty())
            .then(|| Glass { triangles: prop.glass.clone(), returned: glass_returned });
        placed
    }

    /// Ground and objects of `scene` as one mesh, without what is known of its parts.
    #[must_use]
    pub fn mesh(&self, scene: &Scene) -> Mesh {
        let mut whole = scene.ground.mesh();
        for object in &scene.objects {
            let world_from_object = object.world_from_object();
            let surface = &self.prop(object.entry, object.variant).target.surface;
            for &index in surface.kept() {
                let first = whole.vertices.len() as u32;
                let corners = surface.corners(index).map(|corner| surface.frame.to_object(corner));
                whole.vertices.extend(corners.map(|at| world_from_object.transform_point3(at)));
                whole.triangles.push([first, first + 1, first + 2]);
            }
        }
        whole
    }

    /// Scans `targets` by the sensor of `scene`, in place of what stands there.
    ///
    /// # Errors
    /// If the adapter fails.
    pub fn sweep_targets(
        &self,
        scene: &Scene,
        targets: &mut [PlacedTarget<'_>],
    ) -> Result<Sweep, SceneError> {
        let Eye { sensor, pattern, caster } = &self.sensors[scene.sensor];
        let stream =
            |part: u32| StreamKey::new(self.seed, &format!("scene/{}/beams", scene.number), part);
        for (target, part) in targets.iter_mut().zip(0..) {
            target.stream = Some(stream(part));
        }
        let mut request = ScanRequest::new(sensor, pattern, scene.pose);
        request.attributes = [
            Attribute::Range,
            Attribute::Beam,
            Attribute::Ring,
            Attribute::Time,
            Attribute::Object,
        ]
        .into();
        request.culling = self.culling;
        request.motion = scene.motion(pattern.last_s()).map(Arc::new);
        request.stream = stream(u32::MAX);
        let scan = scan_objects(caster, targets, &request)?.scan;
        Ok(Sweep::of(scan, scene))
    }
}

/// All of `mesh` as a surface.
pub(crate) fn whole(mesh: Mesh) -> Surface {
    let kept = (0..mesh.triangles.len() as u32).collect();
    Surface::new(mesh, kept)
}

impl Sweep {
    fn of(mut scan: Scan, scene: &Scene) -> Self {
        let sensor_from_world = scene.pose.world_from_sensor.inverse();
        let origin = DVec3::from_array(std::mem::take(&mut scan.origin)) - scene.pose.position_m;
        for point in &mut scan.positions {
            let from_sensor = DVec3::from_array(point.map(f64::from)) + origin;
            *point = (sensor_from_world * from_sensor).as_vec3().to_array();
        }
        Self { scan }
    }

    /// The points, in the sensor's frame, metres.
    #[must_use]
    pub fn points(&self) -> &[[f32; 3]] {
        &self.scan.positions
    }

    /// Each point's row of beams, from the lowest elevation.
    #[must_use]
    pub fn rings(&self) -> &[u16] {
        self.scan.ring.as_deref().expect("invariant: a sweep is scanned with rings")
    }

    /// What each point lies on, as in [`Sweep::scan`].
    #[must_use]
    pub fn surfaces(&self) -> &[u32] {
        self.scan.object.as_deref().expect("invariant: a sweep is scanned with objects")
    }

    /// How many points lie on the ground, on each object of `scene`, whose sweep this is, and,
    /// last, on nothing but what is in the air.
    #[must_use]
    pub fn points_by_surface(&self, scene: &Scene) -> Vec<u32> {
        let air = scene.objects.len() + 1;
        let mut counts = vec![0; air + 1];
        self.surfaces().iter().for_each(|&surface| counts[air.min(surface as usize)] += 1);
        counts
    }
}

impl Prop {
    fn built_in(kind: ObjectKind, seed: u64, variant: u32) -> Self {
        let Object { mesh, glass } = object(kind, seed, variant);
        Self::of(mesh, glass)
    }

    fn of(mesh: Mesh, glass: Range<u32>) -> Self {
        let (low, high) = bounding_box(mesh.vertices.iter().copied());
        let target = Target::new(whole(mesh), Builder::Sah);
        Self { target, glass, size_m: high - low }
    }

    /// A user's mesh, `height_m` high; `None` of one that is flat.
    fn scaled(mut mesh: Mesh, height_m: f64) -> Option<Self> {
        let (low, high) = bounding_box(mesh.vertices.iter().copied());
        let scale = height_m / (high.z - low.z);
        if !(scale.is_normal() && scale > 0.0) {
            return None;
        }
        stand(&mut mesh);
        mesh.vertices.iter_mut().for_each(|vertex| *vertex *= scale);
        Some(Self::of(mesh, 0..0))
    }
}

/// The meshes of a user's own that `objects` names.
fn own_meshes(
    objects: &Objects,
    meshes: Option<&Path>,
    seed: u64,
) -> Result<Vec<OnceLock<Prop>>, SceneError> {
    let name = objects.meshes.as_deref().unwrap_or_default();
    let missing =
        |folder: &Path, cause: String| SceneError::NoMeshes { folder: folder.to_path_buf(), cause };
    let Some(meshes) = meshes else {
        return Err(missing(Path::new(name), "found no --meshes that names its place".to_owned()));
    };
    let folder = meshes.join(name);
    let files = mesh_files(&folder).map_err(|error| missing(&folder, format!("found: {error}")))?;
    if files.is_empty() {
        return Err(missing(&folder, "found none".to_owned()));
    }
    let span = objects.height_m.unwrap_or([1.0, 1.0].into());
    let stream = StreamKey::new(seed, &format!("meshes/{name}"), 0);
    let ready = files.iter().zip(0..).map(|(file, n)| {
        let loaded = mesh::load(file)?;
        let world = to_world(&loaded.mesh, loaded.format.default_up(), Normalize::None);
        let prop = Prop::scaled(world.mesh, span.at(stream.unit(n)));
        let flat = || SceneError::FlatMesh { file: file.clone() };
        Ok(OnceLock::from(prop.ok_or_else(flat)?))
    });
    ready.collect()
}

/// The mesh files in `folder`, by name.
fn mesh_files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder)?;
    let mut files =
        entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<PathBuf>>>()?;
    files.retain(|file| MeshFormat::from_path(file).is_some());
    files.sort();
    Ok(files)
}
