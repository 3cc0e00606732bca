//! Level of detail: fewer triangles, as far as a sensor cannot tell.
//!
//! A bound in metres, [`Simplify`], says how far the surface that is cast at
//! may lie from the mesh's own. What holds of a simplified mesh was proven of
//! it, whatever the decimation promised:
//!
//! - Every point of the simplified surface lies within the bound of the
//!   original surface, and every point of the original within the bound of the
//!   simplified one (their Hausdorff distance). So every point of a scan lies
//!   within the bound of the mesh.
//! - Hence a beam as wide as the bound on each side meets the original at a
//!   range that differs from the simplified one by no more than the bound.
//! - A beam without width, where both surfaces are one plane and its displaced
//!   copy, finds a range that differs by up to bound / cos(incidence). Near
//!   edges and silhouettes it may meet something else altogether; so it may
//!   with a real sensor, whose beams have width.
//!
//! The choice of triangles is of the crate `meshopt`, whose C++ rounds as its
//! compiler has it: the same program gives the same triangles, another
//! platform's may give others.

#[cfg(feature = "simplify")]
mod decimate;
mod distance;
mod resolution;
mod within;

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, positive};
use crate::mesh::Mesh;
use crate::target::Surface;

pub use distance::{distance_to_surface, distance_to_triangle};
pub use resolution::{FOOTPRINTS_PER_STEP, Viewpoint, resolved_m};
pub use within::lies_within;

/// How far a simplified surface may lie from the mesh's own.
///
/// In TOML, JSON and on the command line `"auto"`, or a number of metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub enum Simplify {
    /// As far as no sensor can tell: see [`resolved_m`].
    Auto,
    /// So many metres, above 0.
    Metres(f64),
}

/// What became of one mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Simplified {
    /// No point lies farther than this from the other surface, metres; 0 where
    /// a sensor may stand on the mesh.
    pub bound_m: f64,
    /// Triangles that were cast at.
    pub triangles: u64,
}

/// This build has no decimation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "this program was built without simplification: build it with `--features simplify`, which \
     needs a C++ compiler"
)]
pub struct NotBuilt;

impl Simplify {
    /// The bound for a mesh of which its sensors resolve `resolved_m`.
    #[must_use]
    pub fn bound_m(self, resolved_m: impl FnOnce() -> f64) -> f64 {
        match self {
            Self::Auto => resolved_m(),
            Self::Metres(bound_m) => bound_m,
        }
    }
}

/// A mesh with fewer triangles than the `kept` ones of `mesh`, and all of the
/// surface within `bound`, in the mesh's units; `None` where there is nothing
/// to gain.
///
/// Its vertices are some of the mesh's own. Triangles that are degenerate or
/// equal to another may be among its triangles, as in a file's.
///
/// # Errors
/// If this build has no decimation.
#[cfg(feature = "simplify")]
pub fn simplified(mesh: &Mesh, kept: &[u32], bound: f64) -> Result<Option<Mesh>, NotBuilt> {
    Ok(decimate::proven(mesh, kept, bound))
}

/// A build without decimation.
///
/// # Errors
/// Always.
#[cfg(not(feature = "simplify"))]
pub fn simplified(_: &Mesh, _: &[u32], _: f64) -> Result<Option<Mesh>, NotBuilt> {
    Err(NotBuilt)
}

/// The surface to cast at: that of [`simplified`], or of the `kept` triangles of
/// `mesh` itself where there is nothing to gain.
///
/// # Errors
/// If this build has no decimation.
pub fn simplified_surface(mesh: Mesh, kept: Vec<u32>, bound: f64) -> Result<Surface, NotBuilt> {
    Ok(match simplified(&mesh, &kept, bound)? {
        Some(fewer) => Surface::of_mesh(fewer),
        None => Surface::new(mesh, kept),
    })
}

/// [`Simplify`] as written.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected \"auto\" or metres as simplify")]
enum Written {
    Metres(f64),
    Word(String),
}

impl TryFrom<Written> for Simplify {
    type Error = InvalidValue;

    fn try_from(written: Written) -> Result<Self, InvalidValue> {
        match written {
            Written::Metres(metres) => positive("simplify", metres).map(|()| Self::Metres(metres)),
            Written::Word(word) if word == "auto" => Ok(Self::Auto),
            Written::Word(word) => {
                let cause = format!("expected \"auto\" or a number of metres, found {word:?}");
                Err(InvalidValue::new("simplify", cause))
            }
        }
    }
}

impl From<Simplify> for Written {
    fn from(simplify: Simplify) -> Self {
        match simplify {
            Simplify::Auto => Self::Word("auto".to_owned()),
            Simplify::Metres(metres) => Self::Metres(metres),
        }
    }
}

impl FromStr for Simplify {
    type Err = InvalidValue;

    fn from_str(word: &str) -> Result<Self, InvalidValue> {
        let metres = word.parse().map(Written::Metres);
        metres.unwrap_or_else(|_| Written::Word(word.to_owned())).try_into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_metres_are_read_as_they_are_written() {
        for simplify in [Simplify::Auto, Simplify::Metres(0.002)] {
            let json = serde_json::to_string(&simplify).unwrap();
            assert_eq!(serde_json::from_str::<Simplify>(&json).unwrap(), simplify);
            assert_eq!(json.trim_matches('"').parse(), Ok(simplify));
        }
    }

    #[test]
    fn what_is_no_bound_is_refused() {
        for word in ["0", "-1", "nan", "inf", "fine", ""] {
            let error = word.parse::<Simplify>().unwrap_err().to_string();
            assert!(error.starts_with("simplify: "), "{error}");
        }
    }
}
