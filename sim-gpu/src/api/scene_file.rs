//! From a scene's file to the scene: meshes and materials are read, meshes are simplified.

use super::import::FilePlace;
use super::{Error, Instance, Mesh, MountedSensor, Scene, Sensor};
use crate::bvh::Builder;
use crate::config::InvalidValue;
use crate::import::Import;
use crate::material::{Material, Materials};
use crate::mesh::frame::{Normalize, to_world};
use crate::mesh::validate::triangle_stats;
use crate::mesh::{LoadedMesh, TriangleMesh, load};
use crate::pose::Pose;
use crate::scene::{SceneFile, SceneObject, SceneSensor};
use crate::simplify::{Simplified, Simplify, Viewpoint, resolved_m, simplified_surface};
use crate::target::Target;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

impl TryFrom<&SceneFile> for Scene {
    type Error = Error;

    fn try_from(file: &SceneFile) -> Result<Self, Error> {
        let mut scene = Self::new();
        scene.seed = file.seed;
        scene.effects.clone_from(&file.effects);
        scene.attributes.clone_from(&file.attributes);
        scene.sensors = file.sensors.iter().map(MountedSensor::from).collect();
        let objects = file.objects.iter().map(|it| ("object", &it.name, &it.motion));
        let sensors = file.sensors.iter().map(|it| ("sensor", &it.name, &it.motion));
        for (kind, name, motion) in objects.chain(sensors) {
            let doubts = motion
                .iter()
                .flat_map(|it| it.doubts(&format!("{kind} {name:?}"), kind == "sensor"));
            scene.doubts.extend(doubts);
        }
        for (i, object) in file.objects.iter().enumerate() {
            if let Some(import) = &object.import {
                scene.add_object(object, import, &format!("object[{i}]"))?;
                continue;
            }
            let (mesh, simplified) = mesh(file, object)?;
            let materials = materials(object)?;
            let warnings = materials.as_ref().map_or(&[][..], |materials| &materials.warnings);
            let mesh = mesh.with_warnings(&object.mesh, warnings);
            let pose = Pose { position_m: object.position_m, rotation: object.rotation };
            let id = scene.add(mesh, pose);
            scene[id] = Instance {
                scale: object.scale,
                motion: object.motion.clone(),
                name: Some(object.name.clone()),
                label: object.label.clone(),
                reflectivity: object.reflectivity,
                retroreflection: object.retroreflection,
                materials: materials.map(Arc::new),
                simplified,
                ..scene[id].clone()
            };
        }
        Ok(scene)
    }
}

impl Scene {
    /// Adds the instances of an object that is a file with more than one mesh.
    fn add_object(
        &mut self,
        object: &SceneObject,
        import: &Import,
        key: &str,
    ) -> Result<(), Error> {
        let metres = DAffine3::from_scale(DVec3::splat(object.units.metres()));
        let place = FilePlace {
            up: object.up,
            world_from_upright: object.world_from_object() * metres,
            prefix: format!("{}/", object.name),
        };
        for id in self.add_file_at(&object.mesh, import, &place)? {
            let instance = &mut self[id];
            if let (Some(_), Some(name)) =
                (object.motion.as_ref().zip(instance.motion.as_ref()), &instance.name)
            {
                let cause =
                    format!("cannot stand beside the animation of the file, which moves {name}");
                return Err(InvalidValue::new(format!("{key}.trajectory"), cause).into());
            }
            instance.motion = instance.motion.take().or_else(|| object.motion.clone());
            instance.label = object.label.clone().or_else(|| instance.label.take());
            if !import.base_colours {
                instance.reflectivity = object.reflectivity;
                instance.retroreflection = object.retroreflection;
            }
        }
        Ok(())
    }
}

impl From<&SceneSensor> for MountedSensor {
    fn from(mounted: &SceneSensor) -> Self {
        let SceneSensor { sensor, name, pose, motion, start_s, deskew } = mounted.clone();
        Self { name, sensor: Sensor::from(sensor), pose, motion, start_s, deskew }
    }
}

fn materials(object: &SceneObject) -> Result<Option<Materials>, Error> {
    let otherwise =
        Material { reflectivity: object.reflectivity, retroreflection: object.retroreflection };
    let load = || Materials::load(&object.mesh, &object.materials, otherwise);
    Ok((!object.materials.is_plain()).then(load).transpose()?)
}

/// The mesh of `object`, and what simplification made of it if it was asked for.
fn mesh(file: &SceneFile, object: &SceneObject) -> Result<(Mesh, Option<Simplified>), Error> {
    let LoadedMesh { mesh, format, mut warnings, .. } = load(&object.mesh)?;
    let mesh = mesh.in_metres(object.units);
    let up = object.up.unwrap_or(format.default_up());
    let normalize = object.normalize.unwrap_or(Normalize::None);
    let (mesh, simplified) = match file.simplify_of(object) {
        None => (Mesh::upright(mesh, up).normalized(normalize), None),
        Some(simplify) => {
            let world = to_world(&mesh, up, normalize);
            // A mesh that is not scaled keeps its own origin.
            let centre = if normalize == Normalize::None { world.centre } else { DVec3::ZERO };
            let (target, simplified) = simplified(file, object, simplify, world.mesh, centre)?;
            (Mesh::from_target(target, centre), Some(simplified))
        }
    };
    if normalize == Normalize::None {
        let doubt = mesh.extent().doubtful_unit(object.units);
        warnings.extend(doubt.map(|doubt| doubt + "; `units` of the object names another unit"));
    }
    Ok((mesh.with_warnings(&object.mesh, &warnings), simplified))
}

fn simplified(
    file: &SceneFile,
    object: &SceneObject,
    simplify: Simplify,
    mesh: TriangleMesh,
    centre: DVec3,
) -> Result<(Target, Simplified), Error> {
    let world_from_mesh = object.world_from_object() * DAffine3::from_translation(centre);
    let kept = triangle_stats(&mesh).kept;
    let bound_m = simplify.bound_m(|| resolved_by(file, object, &mesh, &world_from_mesh));
    // No length of the mesh is longer in the world than by its largest factor.
    let surface = simplified_surface(mesh, kept, bound_m / object.scale.max_element())?;
    let simplified = Simplified { bound_m, triangles: surface.len() as u64 };
    Ok((Target::new(surface, Builder::Sah), simplified))
}

/// What the scene's sensors can tell apart on `mesh`, in metres.
fn resolved_by(
    file: &SceneFile,
    object: &SceneObject,
    mesh: &TriangleMesh,
    world_from_mesh: &DAffine3,
) -> f64 {
    let mesh_from_world = world_from_mesh.inverse();
    let viewpoints = file.sensors.iter().map(|sensor| Viewpoint {
        sensor: &sensor.sensor,
        positions: vec![mesh_from_world.transform_point3(sensor.pose.position_m)],
    });
    let viewpoints: Vec<Viewpoint> = viewpoints.collect();
    // No distance in the world is shorter than by the mesh's least factor.
    let least = object.scale.min_element();
    resolved_m(mesh, least.recip(), &viewpoints) * least
}
