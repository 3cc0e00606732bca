//! What a dataset is to hold. The manifest keeps it in full.

use formats::hash::Hashing;
use formats::rng::StreamKey;
use formats::scan::AttributeSet;
use formats::scan_file::ScanFormat;
use formats::vlp32c::Returns;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use sim_gpu::effects::Effects;
use sim_gpu::internals::config::InvalidValue;
use sim_gpu::internals::material::ColourSource;
use sim_gpu::internals::mesh::frame::{Normalize, Up};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::sensor::{SensorProfile, Views};
use sim_gpu::internals::simplify::Simplify;

/// What a dataset is to hold: with the meshes and the adapter, this decides
/// every byte of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetConfig {
    /// Keys every random number.
    pub seed: u64,
    /// How meshes are scaled into the world.
    pub normalize: Normalize,
    /// The meshes' upward axis; `None` is each format's default.
    pub up: Option<Up>,
    /// Whether and how far meshes are simplified.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simplify: Option<Simplify>,
    /// What points carry besides positions.
    pub attributes: AttributeSet,
    /// The files each scan is written to; NPZ is always among them.
    pub formats: Vec<ScanFormat>,
    /// The effects of [`Variant::Noisy`].
    pub effects: Effects,
    /// Which variants are written.
    pub variants: Vec<Variant>,
    /// The sensors and where they stand.
    pub sets: Vec<SetConfig>,
    /// Points in each packed cloud.
    pub packed_points: u32,
    /// Scans with fewer points are left out of packed sets.
    pub min_points: u32,
    /// Layouts of other projects, besides ours.
    pub layouts: Vec<Layout>,
    /// Which returns packets hold, where they are among the formats.
    #[serde(default, skip_serializing_if = "is_default")]
    pub returns: Returns,
    /// How the manifest hashes the meshes and the files.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hash: Hashing,
    /// The meshes' diffuse reflectivity, 0 to 1.
    #[serde(default = "white", skip_serializing_if = "is_white")]
    pub reflectivity: f64,
    /// Where OBJ meshes have their colours from, if they have; what has none has the
    /// reflectivity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colours: Option<ColourSource>,
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

/// One sensor and where it stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetConfig {
    /// The set's folder, such as `rotational`.
    pub name: String,
    /// The sensor, in full.
    pub sensor: SensorProfile,
    /// Where it stands.
    pub viewpoints: Viewpoints,
}

/// Where a sensor stands around each mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Viewpoints {
    /// Evenly around the mesh.
    Views(Views),
    /// At these poses.
    Poses(Vec<Pose>),
}

formats::named! {
    /// Which effects a scan has; its name is the folder's.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Variant: "variant" {
        /// Exact ranges.
        Clean = "clean",
        /// All the effects asked for.
        Noisy = "noisy",
    }
}

formats::named! {
    /// A layout that another project reads as it is; its name is the folder's.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Layout: "layout" {
        /// Text files of yanx27/Pointnet_Pointnet2_pytorch.
        Yanx27 = "yanx27",
        /// ModelNet40's HDF5 files.
        ModelnetH5 = "modelnet-h5",
        /// Tars of samples, and no other file: see [`tars`](crate::tars).
        Webdataset = "webdataset",
    }
}

impl DatasetConfig {
    /// The effects of one variant of one set. Intensity belongs to both.
    ///
    /// # Errors
    /// If quantisation is wanted and the set's sensor states no quantum.
    pub fn effects_of(&self, set: &SetConfig, variant: Variant) -> Result<Effects, InvalidValue> {
        match variant {
            Variant::Clean => Ok(self.effects.clean()),
            Variant::Noisy => self.effects.for_sensor(&set.sensor),
        }
    }

    /// The effects that must be cast for all variants.
    #[must_use]
    pub fn cast_effects(&self) -> Effects {
        if self.variants.contains(&Variant::Noisy) {
            return self.effects.clone();
        }
        self.effects.clean()
    }
}

impl Viewpoints {
    /// How many places there are.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::Views(views) => views.count as usize,
            Self::Poses(poses) => poses.len(),
        }
    }
}

impl SetConfig {
    /// The poses around the mesh called `id`, whose jitter, if any, is its own.
    #[must_use]
    pub fn poses(&self, seed: u64, id: &str) -> Vec<Pose> {
        match &self.viewpoints {
            Viewpoints::Poses(poses) => poses.clone(),
            Viewpoints::Views(views) => views.poses(DVec3::ZERO, self.views_key(seed, id)),
        }
    }

    /// Number `view` of [`SetConfig::poses`].
    #[must_use]
    pub fn pose(&self, seed: u64, id: &str, view: u32) -> Pose {
        match &self.viewpoints {
            Viewpoints::Poses(poses) => poses[view as usize],
            Viewpoints::Views(views) => views.pose(view, DVec3::ZERO, self.views_key(seed, id)),
        }
    }

    fn views_key(&self, seed: u64, id: &str) -> StreamKey {
        StreamKey::new(seed, &format!("views/{}/{id}", self.name), 0)
    }

    /// The random stream of view `view` of the mesh called `id`.
    #[must_use]
    pub fn stream(&self, seed: u64, id: &str, view: u32) -> StreamKey {
        StreamKey::new(seed, &format!("{}/{id}", self.name), view)
    }
}
