//! Decimation by edge collapse, followed by a proof of its error.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use meshopt::{SimplifyOptions, simplify_decoder};
use rayon::prelude::*;

use super::distance::distance_to_surface;
use super::within::beyond;
use crate::bvh::Builder;
use crate::mesh::TriangleMesh;
use crate::target::{Surface, Target, UnitFrame};

/// The part of the bound that is given to the decimation. Its errors are means over quadrics, not
/// maxima: with all of the bound it would exceed it in a tenth of all places.
const SHARE: f64 = 0.5;

/// The distance around an outlier within which triangles of the mesh are restored, in bounds. They
/// overlap with the simplified surface, so that a beam at less than atan(4) = 76 degrees from the
/// normal cannot pass between two layers one bound apart.
const OVERLAP: f64 = 4.0;

/// A result with more than this part of the triangles is discarded.
const WORTH_IT: f64 = 0.75;

/// Decimates `mesh`, and repairs the places where the error is too large. Triangles without a proof
/// that they lie near the mesh are removed, and the mesh's own triangles around them restored; so
/// are those without a proof that they lie near the simplified surface.
pub(super) fn proven(mesh: &TriangleMesh, kept: &[u32], bound: f64) -> Option<TriangleMesh> {
    if kept.is_empty() || bound.is_nan() || bound <= 0.0 {
        return None;
    }
    let surface = Surface::new(mesh.clone(), kept.to_vec());
    let welded = Welded::new(mesh, kept, &surface.frame);
    let most = (WORTH_IT * welded.corners.len() as f64) as usize;
    // The mesh fits a box of side 2, which limits the error.
    let error = SHARE * (bound / surface.frame.scale).min(2.0);
    let corners = welded.collapsed(error as f32);
    if corners.len() > most {
        return None;
    }
    let original = Target::new(surface, Builder::Morton);
    let corners = repair(mesh, &welded, &original, corners, bound);
    (corners.len() <= most).then(|| welded.mesh_of(mesh, &corners))
}

/// `corners` without the triangles that stray from the `original`, and with the triangles to
/// restore.
fn repair(
    mesh: &TriangleMesh,
    welded: &Welded,
    original: &Target,
    corners: Vec<u32>,
    bound: f64,
) -> Vec<u32> {
    let collapsed = Surface::of_mesh(welded.mesh_of(mesh, &corners));
    let outliers = beyond(&collapsed, original, bound);
    let corners_of = |&nth: &u32| triangle(&corners, nth as usize);
    let strayed: Vec<u32> = outliers.iter().flat_map(corners_of).collect();
    // The proof covers the triangles that the surface keeps: the first of equal ones.
    let stays = |nth: &&u32| outliers.binary_search(nth).is_err();
    let mut left: Vec<u32> = collapsed.kept().iter().filter(stays).flat_map(corners_of).collect();

    let rest = target(welded.mesh_of(mesh, &left));
    let mut back = beyond(&original.surface, &rest, bound);
    if !outliers.is_empty() {
        let strayed = target(welded.mesh_of(mesh, &strayed));
        back.extend(around(&original.surface, &strayed, OVERLAP * bound));
        back.sort_unstable();
        back.dedup();
    }
    let nth = back.iter().filter_map(|t| original.surface.kept().binary_search(t).ok());
    left.extend(nth.flat_map(|nth| triangle(&welded.corners, nth)));
    left
}

fn triangle(corners: &[u32], nth: usize) -> [u32; 3] {
    [0, 1, 2].map(|corner| corners[3 * nth + corner])
}

/// The triangles of `surface` that may have a part within `distance` of `target`.
fn around(surface: &Surface, target: &Target, distance: f64) -> Vec<u32> {
    let (from, to) = (surface.frame, target.surface.frame);
    let is_near = |&&t: &&u32| {
        let corners = surface.corners(t).map(|p| to.to_unit(p * from.scale + from.centre));
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius =
            corners.map(|corner| (corner - middle).length()).into_iter().fold(0.0, f64::max);
        distance_to_surface(target, middle) <= distance / to.scale + radius
    };
    surface.kept().par_iter().filter(is_near).copied().collect()
}

fn target(mesh: TriangleMesh) -> Target {
    Target::new(Surface::of_mesh(mesh), Builder::Morton)
}

/// A mesh in which corners at the same position are the same vertex: files often repeat vertices
/// for each face, and edges would not collapse across such seams.
struct Welded {
    /// In the unit frame, `[n_welded]`.
    positions: Vec<[f32; 3]>,
    /// A vertex of the mesh at each position, `[n_welded]`.
    sources: Vec<u32>,
    /// Indices into `positions`, `[n_kept * 3]`.
    corners: Vec<u32>,
}

impl Welded {
    fn new(mesh: &TriangleMesh, kept: &[u32], frame: &UnitFrame) -> Self {
        const NOT_SEEN: u32 = u32::MAX;
        let mut welded = Self {
            positions: Vec::new(),
            sources: Vec::new(),
            corners: Vec::with_capacity(3 * kept.len()),
        };
        let mut by_vertex = vec![NOT_SEEN; mesh.vertices.len()];
        let mut by_position = HashMap::new();
        for &vertex in kept.iter().flat_map(|&t| &mesh.triangles[t as usize]) {
            let welded_vertex = &mut by_vertex[vertex as usize];
            if *welded_vertex == NOT_SEEN {
                // Adding 0 turns -0 into 0.
                let position = frame.to_unit(mesh.vertices[vertex as usize]).as_vec3() + 0.0;
                *welded_vertex = match by_position.entry(position.to_array().map(f32::to_bits)) {
                    Entry::Occupied(known) => *known.get(),
                    Entry::Vacant(new) => {
                        welded.positions.push(position.to_array());
                        welded.sources.push(vertex);
                        *new.insert(welded.positions.len() as u32 - 1)
                    }
                };
            }
            welded.corners.push(*welded_vertex);
        }
        welded
    }

    /// The corners that remain after collapses that displace the surface by about `error` at most.
    fn collapsed(&self, error: f32) -> Vec<u32> {
        const AS_FAR_AS_THE_ERROR_ALLOWS: usize = 0;
        let absolute = SimplifyOptions::ErrorAbsolute;
        simplify_decoder(
            &self.corners,
            &self.positions,
            AS_FAR_AS_THE_ERROR_ALLOWS,
            error,
            absolute,
            None,
        )
    }

    /// The mesh of triangles with these `corners`, at the f64 positions of `mesh`, without unused
    /// vertices.
    fn mesh_of(&self, mesh: &TriangleMesh, corners: &[u32]) -> TriangleMesh {
        let position = |corner: usize| mesh.vertices[self.sources[corner] as usize];
        of_named(corners.as_chunks().0.to_vec(), self.positions.len(), position)
    }
}

/// The mesh of `triangles`, whose corners are indices below `n` of vertices at `position`. It has
/// the vertices that they use, in the order of their first use.
fn of_named(
    mut triangles: Vec<[u32; 3]>,
    n: usize,
    position: impl Fn(usize) -> glam::DVec3,
) -> TriangleMesh {
    const NOT_NAMED: u32 = u32::MAX;
    let mut numbers = vec![NOT_NAMED; n];
    let mut vertices = Vec::new();
    for corner in triangles.as_flattened_mut() {
        let number = &mut numbers[*corner as usize];
        if *number == NOT_NAMED {
            *number = vertices.len() as u32;
            vertices.push(position(*corner as usize));
        }
        *corner = *number;
    }
    TriangleMesh { vertices, triangles }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::validate::triangle_stats;
    use glam::DVec3;

    #[test]
    fn triangles_that_stray_go_though_there_are_two_of_them() {
        // A roof over a square of 2 m: its four sides, and no floor.
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let mut vertices: Vec<DVec3> = corners.map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
        vertices.push(DVec3::Z);
        let triangles = (0..4).map(|i| [i, (i + 1) % 4, 4]).collect();
        let mesh = TriangleMesh { vertices, triangles };
        let kept = triangle_stats(&mesh).kept;
        let surface = Surface::new(mesh.clone(), kept.clone());
        let welded = Welded::new(&mesh, &kept, &surface.frame);
        let original = Target::new(surface, Builder::Morton);
        // Half a floor twice, up to 0.7 m below the roof, and three of four sides.
        let nth = |vertex: usize| {
            let is = |&source: &u32| source as usize == vertex;
            welded.sources.iter().position(is).unwrap() as u32
        };
        let floor = [0, 1, 2].map(nth);
        let sides = [0, 1, 2].map(|i| triangle(&welded.corners, i));
        let wrong = [floor.as_slice(), &floor, sides.as_flattened()].concat();
        let left = repair(&mesh, &welded, &original, wrong, 0.1);
        let has = |wanted: [u32; 3]| left.as_chunks::<3>().0.contains(&wanted);
        assert!(!has(floor), "{left:?}");
        let all: Vec<bool> = (0..4).map(|i| has(triangle(&welded.corners, i))).collect();
        assert_eq!(all, [true; 4]);
    }
}
