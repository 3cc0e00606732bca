//! The mesh formats, by the extensions of their files.

use std::fmt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::frame::Up;

/// The mesh formats read here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MeshFormat {
    /// Object File Format of Geomview, ASCII.
    Off,
    /// Wavefront OBJ.
    Obj,
    /// Stanford PLY, ASCII or binary of either byte order.
    Ply,
    /// Stereolithography, ASCII or binary.
    Stl,
}

impl MeshFormat {
    const ALL: [Self; 4] = [Self::Off, Self::Obj, Self::Ply, Self::Stl];

    /// The format that the extension of `path` stands for, in either case.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.extension()))
    }

    /// The axis that points up in most files of this format: z in ModelNet's
    /// OFF and in CAD's STL and PLY, y in OBJ.
    #[must_use]
    pub fn default_up(self) -> Up {
        match self {
            Self::Off | Self::Ply | Self::Stl => Up::Z,
            Self::Obj => Up::Y,
        }
    }

    /// The file name extension, in lower case, without its dot.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Stl => "stl",
        }
    }
}

impl fmt::Display for MeshFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.extension())
    }
}

/// The extensions of all mesh formats, in lower case, without dots.
#[must_use]
pub fn mesh_extensions() -> [&'static str; 4] {
    MeshFormat::ALL.map(MeshFormat::extension)
}
