//! From a file's axes and units to the world: z up, in metres.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::Mesh;

/// The axis of a file that points up in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Up {
    /// The y axis: (x, y, z) becomes (x, -z, y).
    Y,
    /// The z axis, as in the world.
    #[default]
    Z,
}

/// How a mesh is moved and scaled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Normalize {
    /// The mean of the vertices to the origin and the farthest vertex to
    /// radius 1, as point clouds of ModelNet are.
    #[default]
    UnitSphere,
    /// The centre of the bounding box to the origin and its longest side to 2,
    /// as in ModelNet40-C.
    Bbox,
    /// The centre of the bounding box to the origin; the scale stays, and the
    /// file's unit is taken for a metre.
    None,
}

/// No such word in a list of words.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{found:?} is none of {expected}")]
pub struct UnknownWord {
    found: String,
    expected: &'static str,
}

impl fmt::Display for Up {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Y => "y",
            Self::Z => "z",
        })
    }
}

impl FromStr for Up {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        match word {
            "y" => Ok(Self::Y),
            "z" => Ok(Self::Z),
            _ => Err(UnknownWord { found: word.into(), expected: "y, z" }),
        }
    }
}

impl fmt::Display for Normalize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::UnitSphere => "unit-sphere",
            Self::Bbox => "bbox",
            Self::None => "none",
        })
    }
}

impl FromStr for Normalize {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        match word {
            "unit-sphere" => Ok(Self::UnitSphere),
            "bbox" => Ok(Self::Bbox),
            "none" => Ok(Self::None),
            _ => Err(UnknownWord { found: word.into(), expected: "unit-sphere, bbox, none" }),
        }
    }
}

/// A mesh in the world, and how it came there:
/// `world = (position - centre) * scale`, `position` being the file's, turned
/// z up.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldMesh {
    /// The mesh, z up, in metres.
    pub mesh: Mesh,
    /// What became the origin, in the file's units.
    pub centre: DVec3,
    /// Metres per unit of the file; at most the largest finite number.
    pub scale: f64,
}

/// Turns `mesh` z up, then moves and scales it as `normalize` says.
///
/// Centre and size are those of the vertices that triangles name: a stray
/// vertex has no say, and is put at the origin, so that it does no harm
/// either. (ModelNet's files have hardly any, so that the mean is ModelNet's.)
/// A mesh without extent is moved only. Any finite coordinates will do: sums
/// are formed relative to the box, and in units of its largest coordinate.
#[must_use]
pub fn to_world(mesh: &Mesh, up: Up, normalize: Normalize) -> WorldMesh {
    let named = named_vertices(mesh);
    let named_positions =
        || mesh.vertices.iter().zip(&named).filter(|(_, named)| **named).map(|(vertex, _)| vertex);

    let largest = named_positions().map(|vertex| vertex.abs().max_element()).fold(0.0, f64::max);
    let unit = power_of_two_near(largest);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for vertex in named_positions() {
        let position = z_up(*vertex, up) / unit;
        (low, high) = (low.min(position), high.max(position));
    }
    let box_centre = if low.x <= high.x { 0.5 * (low + high) } else { DVec3::ZERO };
    let from_box = |vertex: DVec3| z_up(vertex, up) / unit - box_centre;

    let (shift, size) = match normalize {
        Normalize::UnitSphere => {
            let sum: DVec3 = named_positions().map(|vertex| from_box(*vertex)).sum();
            let mean = sum / named_positions().count().max(1) as f64;
            let radii = named_positions().map(|vertex| length(from_box(*vertex) - mean));
            (mean, radii.fold(0.0, f64::max))
        }
        Normalize::Bbox => (DVec3::ZERO, 0.5 * (high - low).max_element()),
        Normalize::None => (DVec3::ZERO, unit.recip()),
    };
    let size = if size > 0.0 { size } else { unit.recip() };
    let moved = |(vertex, named): (&DVec3, &bool)| {
        if *named { (from_box(*vertex) - shift) / size } else { DVec3::ZERO }
    };
    WorldMesh {
        mesh: Mesh {
            vertices: mesh.vertices.iter().zip(&named).map(moved).collect(),
            triangles: mesh.triangles.clone(),
        },
        centre: (box_centre + shift) * unit,
        scale: (size.recip() / unit).min(f64::MAX),
    }
}

/// Which vertices a triangle names, `[n_vertices]`.
pub(super) fn named_vertices(mesh: &Mesh) -> Vec<bool> {
    let mut named = vec![false; mesh.vertices.len()];
    for &corner in mesh.triangles.iter().flatten() {
        named[corner as usize] = true;
    }
    named
}

fn z_up(position: DVec3, up: Up) -> DVec3 {
    match up {
        Up::Y => DVec3::new(position.x, -position.z, position.y),
        Up::Z => position,
    }
}

/// The power of two at or below `value` whose inverse is finite and normal
/// too; 1 for 0. Multiplying by it rounds nothing.
fn power_of_two_near(value: f64) -> f64 {
    const EXPONENT: u64 = 0x7FF << 52;
    let power = f64::from_bits(value.to_bits() & EXPONENT);
    if value == 0.0 { 1.0 } else { power.clamp(f64::MIN_POSITIVE, f64::MIN_POSITIVE.recip()) }
}

/// The length of `v`, which may be as short as squares underflow.
fn length(v: DVec3) -> f64 {
    let longest = v.abs().max_element();
    if longest == 0.0 { 0.0 } else { (v / longest).length() * longest }
}
