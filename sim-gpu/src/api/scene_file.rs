//! From a scene's file to the scene: meshes and materials are read.

use super::import::FilePlace;
use super::{Error, Extent, Instance, InstanceId, Mesh, MountedSensor, Scene, Sensor};
use crate::pose::Pose;
use crate::scene::{SceneFile, SceneObject, SceneSensor};
use edgepuck_mesh::frame::Normalize;
use edgepuck_mesh::import::Import;
use edgepuck_mesh::material::{Material, Materials};
use edgepuck_mesh::{LoadedMesh, load};
use formats::plausible::{mesh_in_scene, motion_of};
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
            let what = format!("{kind} {name:?}");
            let warnings = motion.iter().flat_map(|it| motion_of(&what, kind == "sensor", it));
            scene.warnings.extend(warnings);
        }
        scene.warnings.extend(file.sensors.iter().flat_map(|it| it.sensor.warnings()));
        let sensor_m = |it: &SceneSensor| match &it.motion {
            Some(motion) => motion.at(it.start_s).position_m,
            None => it.pose.position_m,
        };
        let sensors_m: Vec<DVec3> = file.sensors.iter().map(sensor_m).collect();
        for object in &file.objects {
            if let Some(import) = &object.import {
                let ids = scene.add_object(object, import)?;
                scene.judge_size(object, &ids, &sensors_m);
                continue;
            }
            let mesh = mesh(object)?;
            let materials = materials(object)?;
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
                ..scene[id].clone()
            };
            if object.normalize.is_none_or(|it| it == Normalize::None) {
                scene.judge_size(object, &[id], &sensors_m);
            }
        }
        Ok(scene)
    }
}

impl Scene {
    /// Warns of an object, of these instances, whose unit is probably another.
    fn judge_size(&mut self, object: &SceneObject, ids: &[InstanceId], sensors_m: &[DVec3]) {
        let Some(extent) = ids.iter().map(|id| self[*id].extent()).reduce(Extent::and) else {
            return;
        };
        let found = mesh_in_scene(extent.size_m(), object.units, extent.surrounds(sensors_m));
        self.warnings.extend(found.into_iter().map(|it| it.of(object.mesh.display())));
    }

    /// Adds the instances of an object that is a file with more than one mesh.
    fn add_object(
        &mut self,
        object: &SceneObject,
        import: &Import,
    ) -> Result<Vec<InstanceId>, Error> {
        let metres = DAffine3::from_scale(DVec3::splat(object.units.unwrap_or_default().metres()));
        let place = FilePlace {
            up: object.up,
            world_from_upright: object.world_from_object() * metres,
            prefix: format!("{}/", object.name),
        };
        let ids = self.add_file_at(&object.mesh, import, &place)?;
        for id in &ids {
            let instance = &mut self[*id];
            instance.motion = object.motion.clone();
            instance.label = object.label.clone().or_else(|| instance.label.take());
            if !import.base_colours {
                instance.reflectivity = object.reflectivity;
                instance.retroreflection = object.retroreflection;
            }
        }
        Ok(ids)
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
    Ok((!object.materials.is_empty()).then(load).transpose()?)
}

/// The mesh of `object`, with the warnings of its file.
fn mesh(object: &SceneObject) -> Result<Mesh, Error> {
    let LoadedMesh { mesh, format, warnings, .. } = load(&object.mesh)?;
    let mesh = mesh.in_metres(object.units.unwrap_or_default());
    let up = object.up.unwrap_or(format.default_up());
    let normalize = object.normalize.unwrap_or(Normalize::None);
    let mesh = Mesh::upright(mesh, up).normalized(normalize);
    Ok(mesh.with_warnings(&object.mesh, warnings))
}
