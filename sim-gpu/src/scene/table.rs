//! A scene as TOML holds it, and its checks.

use std::collections::BTreeMap;
use std::fmt;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use formats::scan::{Attribute, AttributeSet};
use formats::trajectory::KITTI_PERIOD_S;
use glam::{DQuat, DVec3};
use serde::de::value::SeqAccessDeserializer;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::material_table::MaterialTable;
use super::{SceneObject, SceneSensor};
use crate::config::{self, InvalidValue, one_of, positive, within};
use crate::effects::Effects;
use crate::pose::{Pose, PoseKeys, Trajectory};
use crate::sensor::SensorProfile;
use edgepuck_mesh::frame::{Normalize, Unit, Up};
use edgepuck_mesh::import::{Format, Import};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneTable {
    #[serde(default)]
    pub seed: u64,
    /// The objects, at least one.
    #[serde(default)]
    pub object: Vec<ObjectTable>,
    /// The sensors, at least one; each makes a scan.
    #[serde(default)]
    pub sensor: Vec<SensorTable>,
    #[serde(default)]
    pub effects: Effects,
    /// The attributes of points besides positions, of `range`, `beam`, `ring`, `time`, `triangle`,
    /// `object`, `intensity`, `power`, `reflectivity`, `return`, `medium`, `sensor`, `attitude` and
    /// `normal`.
    #[serde(default)]
    pub attributes: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectTable {
    /// The mesh's file, from the folder of the scene's file. Required without `scene`.
    mesh: Option<PathBuf>,
    /// A glTF file, whose nodes become objects, or a robot (`.urdf`), instead of a mesh.
    scene: Option<PathBuf>,
    /// The positions of the robot's joints by name, radians or metres; 0 by default.
    #[serde(default)]
    joints: BTreeMap<String, f64>,
    /// Whether the robot is made of its collision geometry.
    #[serde(default)]
    collision: bool,
    /// Whether base colours of the glTF file's materials are taken for reflectivities.
    #[serde(default)]
    base_colours: bool,
    name: Option<String>,
    label: Option<String>,
    up: Option<Up>,
    /// The scale and the place of the mesh; by default those of its file.
    normalize: Option<Normalize>,
    #[serde(default)]
    units: Option<Unit>,
    #[serde(default)]
    position_m: [f64; 3],
    yaw_deg: Option<f64>,
    pitch_deg: Option<f64>,
    roll_deg: Option<f64>,
    quaternion_xyzw: Option<[f64; 4]>,
    /// The poses over time of the frame of the pose above.
    trajectory: Option<Motion>,
    scale: Option<Scale>,
    reflectivity: Option<f64>,
    /// The quality as a retro-reflector, such as a road sign: up to 1, which is ideal.
    #[serde(default)]
    retroreflection: f64,
    #[serde(default)]
    materials: BTreeMap<String, MaterialTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SensorTable {
    /// The name of a built-in sensor, or the path of a sensor's file from the scene's.
    profile: String,
    name: Option<String>,
    /// The sensor's position, metres. Without a trajectory it is required, and so is an orientation:
    /// `look_at_m`, angles or `quaternion_xyzw`.
    position_m: Option<[f64; 3]>,
    look_at_m: Option<[f64; 3]>,
    yaw_deg: Option<f64>,
    pitch_deg: Option<f64>,
    roll_deg: Option<f64>,
    quaternion_xyzw: Option<[f64; 4]>,
    /// The poses over time, instead of the keys above.
    trajectory: Option<Motion>,
    /// The revolutions of the scan; by default those of the profile.
    revolutions: Option<NonZeroU32>,
    #[serde(default)]
    start_s: f64,
    #[serde(default)]
    deskew: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TimedPose {
    /// The time of the pose, on the clock of `start_s`.
    time_s: f64,
    position_m: [f64; 3],
    look_at_m: Option<[f64; 3]>,
    yaw_deg: Option<f64>,
    pitch_deg: Option<f64>,
    roll_deg: Option<f64>,
    quaternion_xyzw: Option<[f64; 4]>,
}

/// A trajectory: its file, or its poses.
enum Motion {
    File(String),
    Poses(Vec<TimedPose>),
}

impl<'de> Deserialize<'de> for Motion {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Motion;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a file's name or a list of poses")
            }

            fn visit_str<E>(self, file: &str) -> Result<Motion, E> {
                Ok(Motion::File(file.to_owned()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, poses: A) -> Result<Motion, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(poses)).map(Motion::Poses)
            }
        }
        from.deserialize_any(Either)
    }
}

fn trajectory(
    key: String,
    folder: &Path,
    motion: Option<Motion>,
) -> Result<Option<Arc<Trajectory>>, Vec<InvalidValue>> {
    let wrong = |cause: String| InvalidValue::new(key.clone(), cause);
    let found = match motion {
        None => return Ok(None),
        Some(Motion::File(file)) => {
            Trajectory::load(&folder.join(file)).map_err(|error| wrong(error.to_string()))?
        }
        Some(Motion::Poses(poses)) => {
            let timed = |(i, pose): (usize, TimedPose)| {
                let key = format!("{key}[{i}]");
                let keys = pose.keys();
                let at = match (keys.look_at_m, keys.rotation(&key)?) {
                    (None, None) => Pose::at(keys.position_m(&key)?),
                    _ => keys.pose(&key)?,
                };
                Ok::<_, InvalidValue>((pose.time_s, at))
            };
            let poses = config::all(poses.into_iter().enumerate().map(timed))?;
            Trajectory::new(poses).map_err(|invalid| wrong(invalid.to_string()))?
        }
    };
    Ok(Some(Arc::new(found)))
}

/// Checks the numbers of an object, whose fields stand at `key`.
///
/// # Errors
/// A number beyond its limits.
pub fn check_object(
    key: impl Fn(&str) -> String,
    scale: [f64; 3],
    reflectivity: f64,
    retroreflection: f64,
) -> Result<(), InvalidValue> {
    scale.into_iter().try_for_each(|factor| positive(&key("scale"), factor))?;
    within(&key("reflectivity"), reflectivity, 0.0..=1.0)?;
    within(&key("retroreflection"), retroreflection, 0.0..=1.0)
}

/// Checks the time at which a scan begins, seconds.
pub(crate) fn check_start(key: &str, start_s: f64) -> Result<(), InvalidValue> {
    // Unix times are above 1e9.
    within(key, start_s, -1e12..=1e12)
}

/// Checks that the poses of a sensor cover the scan; a single pose covers all times.
pub(crate) fn check_motion(
    key: &str,
    trajectory: &Trajectory,
    [from_s, to_s]: [f64; 2],
) -> Result<(), InvalidValue> {
    let [first_s, last_s] = trajectory.known_s();
    // Unix times are rounded to 2e-7 s.
    if first_s == last_s || (first_s <= from_s && to_s <= last_s + 1e-6) {
        return Ok(());
    }
    let cause = format!(
        "expected poses from {from_s} s, where the scan begins (start_s), to {to_s} s, found poses \
         from {first_s} s to {last_s} s"
    );
    Err(InvalidValue::new(key, cause))
}

/// Checks that an object's poses overlap the scan: before its first and after its last, it stands
/// still.
pub(super) fn check_moves(
    key: &str,
    trajectory: &Trajectory,
    sensors: &[SceneSensor],
) -> Result<(), InvalidValue> {
    let [first_s, last_s] = trajectory.known_s();
    let is_seen = |sensor: &SceneSensor| {
        let end_s = sensor.start_s + KITTI_PERIOD_S * f64::from(sensor.sensor.revolutions.get());
        sensor.start_s <= last_s && end_s >= first_s
    };
    if first_s == last_s || sensors.is_empty() || sensors.iter().any(is_seen) {
        return Ok(());
    }
    let start_s = sensors[0].start_s;
    let cause = format!(
        "expected poses around {start_s} s, where the scan begins (start_s of the sensor), found \
         poses from {first_s} s to {last_s} s"
    );
    Err(InvalidValue::new(key, cause))
}

impl TimedPose {
    fn keys(&self) -> PoseKeys {
        PoseKeys {
            position_m: self.position_m,
            look_at_m: self.look_at_m,
            yaw_deg: self.yaw_deg,
            pitch_deg: self.pitch_deg,
            roll_deg: self.roll_deg,
            quaternion_xyzw: self.quaternion_xyzw,
        }
    }
}

#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected one number or a list of three as scale")]
enum Scale {
    Uniform(f64),
    PerAxis([f64; 3]),
}

impl ObjectTable {
    /// How its file becomes several instances; none of a mesh's keys stands beside those.
    fn import(&self, key: impl Fn(&str) -> String) -> Result<Option<Import>, InvalidValue> {
        let Self { joints, collision, base_colours, .. } = self;
        let (joints, collision, base_colours) = (joints.clone(), *collision, *base_colours);
        let import = Import { joints, collision, base_colours };
        let Some(file) = &self.scene else {
            let given = [!import.joints.is_empty(), collision, base_colours];
            let names = ["joints", "collision", "base_colours"].into_iter().zip(given);
            return match names.into_iter().find(|(_, is_given)| *is_given) {
                Some((name, _)) => {
                    Err(InvalidValue::new(key(name), "expected it only for a scene"))
                }
                None => Ok(None),
            };
        };
        let given =
            [("normalize", self.normalize.is_some()), ("materials", !self.materials.is_empty())];
        let of_all = [
            ("reflectivity", self.reflectivity.is_some()),
            ("retroreflection", self.retroreflection != 0.0),
        ];
        let of_all =
            of_all.into_iter().filter(|_| base_colours).map(|it| (it, "without base_colours"));
        let mut given = given.into_iter().map(|it| (it, "for a mesh")).chain(of_all);
        if let Some(((name, _), only)) = given.find(|((_, is_given), _)| *is_given) {
            return Err(InvalidValue::new(key(name), format!("expected it only {only}")));
        }
        let found = || {
            let cause = format!("expected .glb, .gltf or .urdf, found {}", file.display());
            InvalidValue::new(key("scene"), cause)
        };
        let format = Format::from_path(file).ok_or_else(found)?;
        match format.foreign_setting(&import) {
            Some((name, of)) => {
                Err(InvalidValue::new(key(name), format!("expected it only for {of}")))
            }
            None => Ok(Some(import)),
        }
    }

    pub fn validate(self, index: usize, folder: &Path) -> Result<SceneObject, Vec<InvalidValue>> {
        let table = format!("object[{index}]");
        let key = |field: &str| format!("{table}.{field}");
        let import = self.import(key)?;
        let (which, file) = match (&self.mesh, &self.scene) {
            (Some(mesh), None) => ("mesh", mesh),
            (None, Some(scene)) => ("scene", scene),
            (mesh, _) => {
                let found = if mesh.is_some() { "both" } else { "neither" };
                let cause = format!("expected mesh or scene, found {found}");
                return Err(InvalidValue::new(table, cause).into());
            }
        };
        let Some(stem) = file.file_stem() else {
            return Err(InvalidValue::new(key(which), "expected the path of a file").into());
        };
        let scale = match self.scale.unwrap_or(Scale::Uniform(1.0)) {
            Scale::Uniform(factor) => [factor; 3],
            Scale::PerAxis(factors) => factors,
        };
        if self.units.is_some() && self.normalize.is_some_and(|it| it != Normalize::None) {
            let cause = "expected a mesh that keeps its size (normalize = \"none\"), since others are scaled";
            return Err(InvalidValue::new(key("units"), cause).into());
        }
        let reflectivity = self.reflectivity.unwrap_or(1.0);
        let numbers = check_object(key, scale, reflectivity, self.retroreflection);
        let keys = PoseKeys {
            position_m: self.position_m,
            look_at_m: None,
            yaw_deg: self.yaw_deg,
            pitch_deg: self.pitch_deg,
            roll_deg: self.roll_deg,
            quaternion_xyzw: self.quaternion_xyzw,
        };
        let [position, rotation] =
            [keys.position_m(&table).map(drop), keys.rotation(&table).map(drop)];
        config::all([numbers, position, rotation])?;
        let own = self.materials.into_iter().map(|(name, material)| {
            let material = material.material(&format!("{table}.materials.{name}"))?;
            Ok((name, material))
        });
        let by_name = own.collect::<Result<_, InvalidValue>>()?;
        let name = self.name.unwrap_or_else(|| stem.to_string_lossy().into_owned());
        Ok(SceneObject {
            name: named(&table, name)?,
            mesh: folder.join(file),
            import,
            label: self.label,
            up: self.up,
            normalize: self.normalize,
            units: self.units,
            position_m: keys.position_m(&table)?,
            rotation: keys.rotation(&table)?.unwrap_or(DQuat::IDENTITY),
            motion: trajectory(key("trajectory"), folder, self.trajectory)?,
            scale: DVec3::from_array(scale),
            reflectivity,
            retroreflection: self.retroreflection,
            materials: by_name,
        })
    }
}

impl SensorTable {
    pub fn validate(
        self,
        index: usize,
        folder: &Path,
        effects: &Effects,
    ) -> Result<SceneSensor, Vec<InvalidValue>> {
        let table = format!("sensor[{index}]");
        let key = |field: &str| format!("{table}.{field}");
        let sensor = SensorProfile::resolve_in(folder, &self.profile).map_err(|error| {
            InvalidValue::new(key("profile"), error.to_string().replace('\n', "\n  "))
        })?;
        let name = named(&table, self.name.unwrap_or_else(|| sensor.name.clone()))?;
        let rounded = Effects { quantum: effects.quantum, ..Effects::default() };
        let others = Effects { quantum: None, ..effects.clone() };
        config::all([others, rounded].map(|effects| {
            effects.for_sensor(&sensor).map_err(|InvalidValue { key, cause }| {
                InvalidValue::new(key, format!("{cause}: {table}, \"{name}\""))
            })
        }))?;
        let sensor = match self.revolutions {
            None => sensor,
            Some(revolutions) => sensor
                .with_revolutions(revolutions)
                .map_err(|invalid| InvalidValue::new(key("revolutions"), invalid.cause))?,
        };
        let motion = trajectory(key("trajectory"), folder, self.trajectory)?;
        let (start_s, deskew) = (self.start_s, self.deskew);
        check_start(&key("start_s"), start_s)?;
        if let Some(motion) = motion {
            if self.position_m.is_some() {
                let cause = "cannot stand beside position_m: the trajectory has the poses";
                return Err(InvalidValue::new(key("trajectory"), cause).into());
            }
            let last_s = sensor.pattern().last_s();
            check_motion(&key("trajectory"), &motion, [start_s, start_s + last_s])?;
            let pose = motion.at(start_s);
            return Ok(SceneSensor { sensor, name, pose, motion: Some(motion), start_s, deskew });
        }
        let Some(position_m) = self.position_m else {
            let cause = "expected position_m or trajectory, found neither";
            return Err(InvalidValue::new(table, cause).into());
        };
        let keys = PoseKeys {
            position_m,
            look_at_m: self.look_at_m,
            yaw_deg: self.yaw_deg,
            pitch_deg: self.pitch_deg,
            roll_deg: self.roll_deg,
            quaternion_xyzw: self.quaternion_xyzw,
        };
        let pose = keys.pose(&table)?;
        Ok(SceneSensor { sensor, name, pose, motion, start_s, deskew })
    }
}

/// The attributes, if all are known, unique, and have their effect.
pub(super) fn check_attributes(
    attributes: &[String],
    effects: &Effects,
) -> Result<AttributeSet, Vec<InvalidValue>> {
    let mut set = AttributeSet::new();
    let checked = attributes.iter().enumerate().map(|(i, word)| {
        let wrong = |cause: String| InvalidValue::new(format!("attributes[{i}]"), cause);
        let attribute = word.parse().map_err(|_| {
            let known = Attribute::ALL.map(Attribute::name);
            wrong(one_of(word, &known))
        })?;
        if attribute == Attribute::Intensity && effects.intensity.is_none() {
            return Err(wrong("intensity requires effects.intensity = true".to_owned()));
        }
        if !set.insert(attribute) {
            return Err(wrong(format!("found \"{word}\" in the list twice")));
        }
        Ok(())
    });
    config::all(checked)?;
    Ok(set)
}

fn named(table: &str, name: String) -> Result<String, InvalidValue> {
    if name.trim().is_empty() {
        return Err(InvalidValue::new(format!("{table}.name"), "expected a name, found none"));
    }
    Ok(name)
}
