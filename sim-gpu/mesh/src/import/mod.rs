//! Files of others as what stands in a scene: glTF with its nodes, and robots in URDF.

mod shapes;
mod urdf;

use std::collections::BTreeMap;
use std::path::Path;

use glam::DAffine3;

use crate::frame::Up;
use crate::{Assembly, MeshError, MeshFormat, load_assembly};

pub use urdf::parse as parse_urdf;

/// How a glTF file or a robot becomes instances of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Import {
    /// Whether the base colours of a glTF file's materials are taken for reflectivities: the
    /// luminance (ITU-R BT.709) of their linear factors. It is that of visible light, while many
    /// sensors see at 905 nm. Their images are left out. By default, all reflectivities are 1.
    pub base_colours: bool,
    /// The positions of a robot's joints by name, radians or metres; 0 by default.
    pub joints: BTreeMap<String, f64>,
    /// Whether a robot is made of its links' collision geometry in place of the visual one.
    pub collision: bool,
}

/// A file that holds more than one mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Format {
    /// glTF 2.0.
    Gltf,
    /// A robot.
    Urdf,
}

impl Format {
    /// The format of the extension of `path`.
    #[must_use]
    pub fn from_path(path: &Path) -> Option<Self> {
        match MeshFormat::from_path(path) {
            Some(MeshFormat::Glb | MeshFormat::Gltf) => Some(Self::Gltf),
            Some(_) => None,
            None => path.extension()?.eq_ignore_ascii_case("urdf").then_some(Self::Urdf),
        }
    }

    /// The axis that points up: y in glTF, z in URDF.
    #[must_use]
    pub fn default_up(self) -> Up {
        match self {
            Self::Gltf => Up::Y,
            Self::Urdf => Up::Z,
        }
    }

    /// A setting of `import` that is for files of the other format: its name, and those files.
    #[must_use]
    pub fn foreign_setting(self, import: &Import) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Gltf if !import.joints.is_empty() => Some(("joints", "robots (.urdf)")),
            Self::Gltf if import.collision => Some(("collision", "robots (.urdf)")),
            Self::Urdf if import.base_colours => Some(("base_colours", "glTF (.glb, .gltf)")),
            _ => None,
        }
    }

    /// Reads the file at `path`; `world_from_file` maps its root, in the axes of the file.
    ///
    /// # Errors
    /// The file cannot be read, or is not of this format: with the node, accessor, link or joint.
    pub fn load(
        self,
        path: &Path,
        import: &Import,
        world_from_file: DAffine3,
    ) -> Result<Assembly, MeshError> {
        match self {
            Self::Gltf => load_assembly(path, world_from_file),
            Self::Urdf => urdf::load(path, import, world_from_file),
        }
    }
}
