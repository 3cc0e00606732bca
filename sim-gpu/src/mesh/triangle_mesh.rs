//! The mesh type of all formats.

use super::frame::Unit;
use glam::DVec3;

/// A triangle mesh in f64.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions in the file's units, `[n_vertices]`, all finite.
    pub vertices: Vec<DVec3>,
    /// Corners as indices into `vertices`, `[n_triangles, 3]`, in the file's order; all in range.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// The same mesh in metres, from coordinates in this unit.
    #[must_use]
    pub fn in_metres(mut self, unit: Unit) -> Self {
        if unit != Unit::Metre {
            self.vertices.iter_mut().for_each(|vertex| *vertex *= unit.metres());
        }
        self
    }
}

/// The result of parsing a mesh file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parsed {
    /// The mesh, with a triangle, finite vertices and indices in range once it was checked.
    pub mesh: TriangleMesh,
    /// The number of faces of fewer than three corners, which were dropped.
    pub dropped_faces: usize,
}

impl Parsed {
    /// Appends a face as a fan around its first corner, or counts it as dropped if it has fewer
    /// than three corners.
    pub(super) fn add_face(&mut self, corners: &[u32]) {
        self.dropped_faces += usize::from(corners.len() < 3);
        let sides = corners.windows(2).skip(1);
        self.mesh.triangles.extend(sides.map(|side| [corners[0], side[0], side[1]]));
    }
}
