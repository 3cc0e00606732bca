//! Level of detail: fewer triangles, with a change below the resolution of sensors.
//!
//! A bound in metres, [`Simplify`], limits the distance between the simplified surface and the
//! mesh's own. Its properties are proven for each mesh, independently of the decimation:
//!
//! - Every point of the simplified surface lies within the bound of the original surface, and every
//!   point of the original within the bound of the simplified one (their Hausdorff distance). So
//!   every point of a scan lies within the bound of the mesh.
//! - Hence a beam as wide as the bound on each side meets the original at a range that differs from
//!   the simplified one by at most the bound.
//! - For a beam without width, where one surface is a plane and the other a displaced copy, ranges
//!   differ by up to bound / cos(incidence). Near edges and silhouettes it may meet another
//!   surface, as may the wide beams of a real sensor.
//!
//! The crate `meshopt` chooses the triangles. Its C++ rounds as its compiler does: the same program
//! gives the same triangles, but those of another platform may differ.

#[cfg(feature = "simplify")]
mod decimate;
mod distance;
mod resolution;
#[cfg(feature = "simplify")]
mod within;

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, positive};
use crate::mesh::TriangleMesh;
use crate::target::Surface;

pub use distance::{distance_to_surface, distance_to_triangle};
pub use resolution::{FOOTPRINTS_PER_STEP, Viewpoint, resolved_m};

/// The bound of the distance between a simplified surface and the mesh's own.
///
/// In TOML, JSON and on the command line `"auto"`, or a number of metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub enum Simplify {
    /// The resolution of the sensors: see [`resolved_m`].
    Auto,
    /// A number of metres, above 0.
    Metres(f64),
}

/// The result of simplifying a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Simplified {
    /// The bound of the distance between the surfaces, metres; 0 if a sensor may stand on the mesh.
    pub bound_m: f64,
    /// The number of triangles of the simplified mesh.
    pub triangles: u64,
}

/// This build does not include decimation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "this program was built without simplification: build it with `--features simplify`, which \
     needs a C++ compiler"
)]
pub struct NotBuilt;

impl Simplify {
    /// The bound for a mesh whose sensors resolve `resolved_m`.
    #[must_use]
    pub fn bound_m(self, resolved_m: impl FnOnce() -> f64) -> f64 {
        match self {
            Self::Auto => resolved_m(),
            Self::Metres(bound_m) => bound_m,
        }
    }
}

/// Simplifies the `kept` triangles of `mesh` within `bound`, in the mesh's units; `None` if that
/// saves too little.
///
/// The vertices are some of the mesh's own. As in a file, some triangles may be degenerate or
/// duplicates.
#[cfg(feature = "simplify")]
pub fn simplified(
    mesh: &TriangleMesh,
    kept: &[u32],
    bound: f64,
) -> Result<Option<TriangleMesh>, NotBuilt> {
    Ok(decimate::proven(mesh, kept, bound))
}

/// Stands in for decimation, which this build does not include.
#[cfg(not(feature = "simplify"))]
pub fn simplified(_: &TriangleMesh, _: &[u32], _: f64) -> Result<Option<TriangleMesh>, NotBuilt> {
    Err(NotBuilt)
}

/// The surface of [`simplified`], or of the `kept` triangles of `mesh` if that saves too little.
pub fn simplified_surface(
    mesh: TriangleMesh,
    kept: Vec<u32>,
    bound: f64,
) -> Result<Surface, NotBuilt> {
    Ok(match simplified(&mesh, &kept, bound)? {
        Some(fewer) => Surface::of_mesh(fewer),
        None => Surface::new(mesh, kept),
    })
}

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
