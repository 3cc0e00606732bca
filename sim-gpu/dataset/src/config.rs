//! The settings of a dataset. The manifest keeps them in full.

use edgepuck_mesh::frame::{Normalize, Unit, Up};
use formats::hash::Hashing;
use formats::rng::StreamKey;
use formats::scan::AttributeSet;
use formats::scan_file::ScanFormat;
use formats::streams::Stream;
use formats::vlp32c::Returns;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use sim_gpu::effects::Effects;
use sim_gpu::errors::InvalidValue;
use sim_gpu::sensors::Views;
use sim_gpu::{Pose, Sensor};

/// The settings of a dataset. With the meshes and the adapter, they decide every byte of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetConfig {
    /// Seed of all random numbers.
    pub seed: u64,
    /// How meshes are scaled into the world.
    pub normalize: Normalize,
    /// The unit of the meshes' coordinates.
    #[serde(default, skip_serializing_if = "is_default")]
    pub units: Unit,
    /// The meshes' upward axis; `None` is each format's default.
    pub up: Option<Up>,
    /// The attributes of points besides their positions.
    pub attributes: AttributeSet,
    /// The formats in which each scan is written. NPZ must be among them.
    pub formats: Vec<ScanFormat>,
    /// The effects of [`Variant::Noisy`].
    pub effects: Effects,
    /// The variants to write.
    pub variants: Vec<Variant>,
    /// The sensors and their viewpoints.
    pub sets: Vec<SetConfig>,
    /// Points in each packed cloud.
    pub packed_points: u32,
    /// Points that a scan must have to be packed.
    pub min_points: u32,
    /// Layouts of other projects to write besides our own.
    pub layouts: Vec<Layout>,
    /// The returns that packets hold, if packets are among the formats.
    #[serde(default, skip_serializing_if = "is_default")]
    pub returns: Returns,
    /// The hash of the meshes and the files in the manifest.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hash: Hashing,
    /// The meshes' diffuse reflectivity, 0 to 1.
    #[serde(default = "white", skip_serializing_if = "is_white")]
    pub reflectivity: f64,
}

fn white() -> f64 {
    1.0
}

fn is_white(reflectivity: &f64) -> bool {
    *reflectivity == white()
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// One sensor and its viewpoints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetConfig {
    /// The name of the set and of its folder, such as `rotational`.
    pub name: String,
    /// The sensor, in full.
    pub sensor: Sensor,
    /// Its viewpoints.
    pub viewpoints: Viewpoints,
}

/// The viewpoints of a sensor around each mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Viewpoints {
    /// Evenly around the mesh.
    Views(Views),
    /// At these poses.
    Poses(Vec<Pose>),
}

formats::named! {
    /// The effects of a scan; the name is that of its folder.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Variant: "variant" {
        /// No effect but intensity: exact ranges.
        Clean = "clean",
        /// All effects of the settings.
        Noisy = "noisy",
    }
}

formats::named! {
    /// A layout that another project reads; the name is that of its folder.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Layout: "layout" {
        /// Tars of samples, which [`make_tars`](crate::make_tars) writes.
        Webdataset = "webdataset",
    }
}

impl DatasetConfig {
    /// Settings for `sets`: meshes scaled to the unit sphere, clean scans as NPZ files, and packed clouds
    /// of 1,024 points.
    #[must_use]
    pub fn new(sets: Vec<SetConfig>) -> Self {
        Self {
            seed: 0,
            normalize: Normalize::default(),
            units: Unit::Metre,
            up: None,
            attributes: AttributeSet::new(),
            formats: vec![ScanFormat::Npz],
            effects: Effects::default(),
            variants: vec![Variant::Clean],
            sets,
            packed_points: 1024,
            min_points: 64,
            layouts: Vec::new(),
            returns: Returns::default(),
            hash: Hashing::default(),
            reflectivity: white(),
        }
    }

    /// The effects of `variant` of `set`. Intensity belongs to both variants.
    ///
    /// # Errors
    /// If the settings quantise ranges by the sensor's quantum and the sensor states none.
    pub fn effects_of(&self, set: &SetConfig, variant: Variant) -> Result<Effects, InvalidValue> {
        match variant {
            Variant::Clean => Ok(self.effects.clean()),
            Variant::Noisy => self.effects.for_sensor(set.sensor.profile()),
        }
    }

    /// The effects that the caster must model for all variants.
    #[must_use]
    pub fn cast_effects(&self) -> Effects {
        if self.variants.contains(&Variant::Noisy) {
            return self.effects.clone();
        }
        self.effects.clean()
    }
}

impl Viewpoints {
    /// The number of viewpoints.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::Views(views) => views.count as usize,
            Self::Poses(poses) => poses.len(),
        }
    }
}

impl SetConfig {
    /// The set `name` of `sensor`, at its usual viewpoints.
    #[must_use]
    pub fn new(name: &str, sensor: Sensor) -> Self {
        let viewpoints = Viewpoints::Views(sensor.profile().default_views());
        Self { name: name.to_owned(), sensor, viewpoints }
    }

    /// The poses for the mesh `id`: as given, or around `centre`. Jitter, if there is any, differs by
    /// mesh.
    #[must_use]
    pub fn poses(&self, seed: u64, id: &str, centre: DVec3) -> Vec<Pose> {
        match &self.viewpoints {
            Viewpoints::Poses(poses) => poses.clone(),
            Viewpoints::Views(views) => views.poses(centre, self.views_key(seed, id)),
        }
    }

    /// Pose `view` of [`SetConfig::poses`].
    #[must_use]
    pub fn pose(&self, seed: u64, id: &str, centre: DVec3, view: u32) -> Pose {
        match &self.viewpoints {
            Viewpoints::Poses(poses) => poses[view as usize],
            Viewpoints::Views(views) => views.pose(view, centre, self.views_key(seed, id)),
        }
    }

    fn views_key(&self, seed: u64, id: &str) -> StreamKey {
        Stream::Views { set: &self.name, mesh: id }.key(seed)
    }

    /// The random stream of view `view` of the mesh `id`.
    #[must_use]
    pub fn stream(&self, seed: u64, id: &str, view: u32) -> StreamKey {
        Stream::View { set: &self.name, mesh: id, view }.key(seed)
    }
}
