//! The mesh formats, by the extensions of their files.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::frame::Up;

formats::named! {
    /// The mesh formats. Their names are the extensions of files.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum MeshFormat: "mesh format" {
        /// Object File Format of Geomview, ASCII.
        Off = "off",
        /// Wavefront OBJ.
        Obj = "obj",
        /// Stanford PLY, ASCII or binary of either byte order.
        Ply = "ply",
        /// Stereolithography, ASCII or binary.
        Stl = "stl",
        /// glTF 2.0 in one binary file.
        Glb = "glb",
        /// glTF 2.0 as JSON, with its buffers in it or beside it.
        Gltf = "gltf",
    }
}

impl MeshFormat {
    /// The format of the extension of `path`, in upper or lower case.
    #[must_use]
    pub fn from_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.name()))
    }

    /// The axis that points up in most files of this format: z in OFF (ModelNet), STL and PLY
    /// (CAD), y in OBJ and, by its specification, in glTF.
    #[must_use]
    pub fn default_up(self) -> Up {
        match self {
            Self::Off | Self::Ply | Self::Stl => Up::Z,
            Self::Obj | Self::Glb | Self::Gltf => Up::Y,
        }
    }
}

/// The extensions of all mesh formats, in lower case, without dots.
#[must_use]
pub fn mesh_extensions() -> [&'static str; 6] {
    MeshFormat::ALL.map(MeshFormat::name)
}
