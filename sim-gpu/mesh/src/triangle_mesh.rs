//! The mesh type of all formats.

use formats::plausible::Warning;
use glam::DVec3;
use std::ops::Range;

use super::polygon;

/// A triangle mesh in f64.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions in the file's units, `[n_vertices]`, all finite.
    pub vertices: Vec<DVec3>,
    /// Corners as indices into `vertices`, `[n_triangles, 3]`, in the file's order; all in range.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// Moves vertices that are not finite and that no triangle uses to one that is used: the bounding
    /// box is that of the triangles, and all indices stay.
    pub(super) fn settle_unused(&mut self) {
        if self.vertices.iter().all(|vertex| vertex.is_finite()) {
            return;
        }
        let mut is_used = vec![false; self.vertices.len()];
        for corner in self.triangles.iter().flatten() {
            is_used.get_mut(*corner as usize).into_iter().for_each(|used| *used = true);
        }
        let Some(first) = is_used.iter().position(|used| *used) else { return };
        let place = self.vertices[first];
        for (vertex, is_used) in self.vertices.iter_mut().zip(is_used) {
            if !is_used && !vertex.is_finite() {
                *vertex = place;
            }
        }
    }

    /// The error of the first vertex that is not finite.
    pub(super) fn check_finite(&self) -> Result<(), String> {
        let n = self.vertices.len();
        let number = self.vertices.iter().position(|vertex| !vertex.is_finite());
        number.map_or(Ok(()), |at| {
            let found = self.vertices[at];
            Err(format!("vertex {} of {n}: expected finite coordinates, found {found}", at + 1))
        })
    }
}

/// The result of parsing a mesh file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parsed {
    /// The mesh, with a triangle, finite vertices and indices in range once it was checked.
    pub mesh: TriangleMesh,
    /// The number of faces of fewer than three corners, which were dropped.
    pub dropped_faces: usize,
    /// What is probably wrong with the file.
    pub warnings: Vec<Warning>,
    n_faces: usize,
    /// The faces of more than three corners: their number from 1, and their triangles.
    polygons: Vec<(usize, Range<usize>)>,
}

impl Parsed {
    /// Appends a face as a fan around its first corner, or counts it as dropped if it has fewer
    /// than three corners.
    pub(super) fn add_face(&mut self, corners: &[u32]) {
        self.n_faces += 1;
        self.dropped_faces += usize::from(corners.len() < 3);
        let first = self.mesh.triangles.len();
        self.mesh.triangles.extend(polygon::fan(corners));
        if corners.len() > 3 {
            self.polygons.push((self.n_faces, first..self.mesh.triangles.len()));
        }
    }

    /// Replaces the fans that do not cover their polygons, once all vertices are there and checked.
    pub(super) fn cut_polygons(&mut self) {
        let (mut crossing, mut uneven) = (Vec::new(), Vec::new());
        for (face, range) in std::mem::take(&mut self.polygons) {
            let TriangleMesh { vertices, triangles } = &mut self.mesh;
            let fan = &mut triangles[range];
            let corners = polygon::corners(fan);
            let cut = polygon::cut(corners.iter().map(|i| vertices[*i as usize]).collect());
            if let Some(cuts) = &cut.triangles {
                for (triangle, cut) in fan.iter_mut().zip(cuts) {
                    *triangle = cut.map(|corner| corners[corner]);
                }
            }
            crossing.extend(cut.crosses_itself.then_some(face));
            uneven.extend(cut.is_uneven.then_some(face));
        }
        for (cross, faces) in [(true, crossing), (false, uneven)] {
            let (n, of) = (faces.len(), self.n_faces);
            let guessed = faces.first().map(|&first| Warning::GuessedFaces { cross, n, of, first });
            self.warnings.extend(guessed);
        }
    }
}
