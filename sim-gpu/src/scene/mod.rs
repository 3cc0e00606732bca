//! Scenes in TOML: objects, sensors, effects and attributes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use formats::scan::AttributeSet;
use glam::{DAffine3, DQuat, DVec3};

use crate::config::{self, ConfigError, InvalidValue};
use crate::effects::Effects;
use crate::pose::{Pose, Trajectory};
use crate::sensor::SensorProfile;
use edgepuck_mesh::frame::{Normalize, Unit, Up};
use edgepuck_mesh::import::Import;
use edgepuck_mesh::material::Material;

mod material_table;
mod table;

pub use table::check_object;
pub(crate) use table::{check_motion, check_start};

#[cfg(test)]
mod tests;

/// The content of a scene's file, checked; the meshes are not read yet.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// Seed of all random effects; default 0.
    pub seed: u64,
    /// The objects, at least one, with different names.
    pub objects: Vec<SceneObject>,
    /// The sensors, at least one, with different names; one scan each.
    pub sensors: Vec<SceneSensor>,
    /// The effects of all sensors.
    pub effects: Effects,
    /// The attributes of points besides positions.
    pub attributes: AttributeSet,
}

/// An object of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneObject {
    /// The file of its mesh or meshes; relative paths were relative to the scene's file.
    pub mesh: PathBuf,
    /// How its file becomes several instances, if it is a glTF file with its nodes or a robot.
    pub import: Option<Import>,
    /// Default: the stem of the file's name.
    pub name: String,
    /// A class name, if it has one.
    pub label: Option<String>,
    /// The mesh's upward axis, `y` or `z`; `None` is the format's default.
    pub up: Option<Up>,
    /// `unit-sphere`, `bbox` or `none`. `None`, the default, is `none`: the mesh keeps its units.
    pub normalize: Option<Normalize>,
    /// The unit of its file; `None` is the metre.
    pub units: Option<Unit>,
    /// The position of the mesh's origin, metres.
    pub position_m: DVec3,
    /// The rotation of the upright, scaled mesh.
    pub rotation: DQuat,
    /// The poses over time of the frame that it stands in, if it moves.
    pub motion: Option<Arc<Trajectory>>,
    /// Factors along the mesh's axes once upright, all above 0.
    pub scale: DVec3,
    /// The part of the light that it returns at vertical incidence, 0..=1. Default 1.
    pub reflectivity: f64,
    /// As [`Material::retroreflection`]; default 0.
    pub retroreflection: f64,
    /// The materials of its faces by name, for OBJ only; by default a single one.
    pub materials: BTreeMap<String, Material>,
}

/// A sensor of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSensor {
    /// The sensor, from its profile.
    pub sensor: SensorProfile,
    /// Default: the sensor's name.
    pub name: String,
    /// Its pose; if it moves, that at the start of the scan.
    pub pose: Pose,
    /// Its poses over time, if it moves.
    pub motion: Option<Arc<Trajectory>>,
    /// The time of all trajectories at which its scan begins, seconds; 0 by default.
    pub start_s: f64,
    /// Whether the motion of the sensor is compensated in its points; false by default.
    pub deskew: bool,
}

impl SceneFile {
    /// Reads a scene and its sensor profiles.
    pub fn load(file: &Path) -> Result<Self, ConfigError> {
        config::read(file, "a scene", |table| Self::from_table(table, file))
    }

    /// Parses a scene in `file`, which need not exist; relative paths start from its folder.
    pub fn parse(text: &str, file: &Path) -> Result<Self, ConfigError> {
        config::parse(text, file, |table| Self::from_table(table, file))
    }

    fn from_table(table: table::SceneTable, file: &Path) -> Result<Self, Vec<InvalidValue>> {
        let folder = file.parent().unwrap_or(Path::new(""));
        let effects = table.effects;
        let attributes = table::check_attributes(&table.attributes, &effects);
        let object = |(i, object): (_, table::ObjectTable)| object.validate(i, folder);
        let objects = config::all(table.object.into_iter().enumerate().map(object));
        let sensor = |(i, sensor): (_, table::SensorTable)| sensor.validate(i, folder, &effects);
        let sensors = config::all(table.sensor.into_iter().enumerate().map(sensor));
        let (attributes, objects, sensors) = match (attributes, objects, sensors) {
            (Ok(attributes), Ok(objects), Ok(sensors)) => (attributes, objects, sensors),
            (attributes, objects, sensors) => {
                let wrong = [attributes.err(), objects.err(), sensors.err()];
                let mut wrong: Vec<_> = wrong.into_iter().flatten().flatten().collect();
                // Sensors may share a broken profile.
                let mut known = std::collections::HashSet::new();
                wrong.retain(|it| {
                    let is_file = it.key.ends_with(".profile") && !it.cause.starts_with("expected");
                    !is_file || known.insert(it.cause.clone())
                });
                return Err(wrong);
            }
        };
        if effects.motion.is_some() && sensors.iter().all(|sensor| sensor.motion.is_some()) {
            let cause = "expected a sensor without a trajectory, which it would move, found none";
            return Err(InvalidValue::new("effects.motion", cause).into());
        }
        config::all([
            check_names("object", objects.iter().map(|object| &object.name)),
            check_names("sensor", sensors.iter().map(|sensor| &sensor.name)),
        ])?;
        for (i, object) in objects.iter().enumerate() {
            if let Some(trajectory) = &object.motion {
                let key = format!("object[{i}].trajectory");
                table::check_moves(&key, trajectory, &sensors)?;
            }
        }

        Ok(Self { seed: table.seed, objects, sensors, effects, attributes })
    }
}

impl SceneObject {
    /// The map from the upright, normalised mesh to the world.
    #[must_use]
    pub fn world_from_object(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.position_m)
    }
}

/// Checks that there is at least one item, and that names are unique.
fn check_names<'a>(
    kind: &str,
    names: impl Iterator<Item = &'a String>,
) -> Result<(), InvalidValue> {
    let mut first_with = std::collections::HashMap::new();
    for (i, name) in names.enumerate() {
        if let Some(first) = first_with.insert(name, i) {
            let cause = format!("\"{name}\" is the name of {kind}[{first}] too; set `name`");
            return Err(InvalidValue::new(format!("{kind}[{i}].name"), cause));
        }
    }
    if first_with.is_empty() {
        return Err(InvalidValue::new(
            kind,
            format!("expected at least one [[{kind}]], found none"),
        ));
    }
    Ok(())
}
