//! The triangles of a mesh that a beam can meet, and the defects of the others.

use glam::{DVec3, Vec3};
use hashbrown::{DefaultHashBuilder, HashTable};
use serde::{Deserialize, Serialize};
use std::hash::BuildHasher;

use super::frame::named_vertices;
use super::triangle_mesh::TriangleMesh;
use super::unit_frame::UnitFrame;

/// Counts of the redundant parts of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshDefects {
    /// Triangles without area in f32.
    pub degenerate: usize,
    /// Triangles with area whose three f32 corners are those of an earlier triangle, in any order.
    pub duplicate: usize,
    /// Vertices that no triangle refers to.
    pub unreferenced: usize,
}

/// The defects of a mesh, and the triangles that remain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TriangleStats {
    /// The defects.
    pub defects: MeshDefects,
    /// The indices of the triangles that are neither degenerate nor duplicates, ascending.
    pub kept: Vec<u32>,
}

/// Separates the triangles of `mesh` that rays can meet from the others.
///
/// Corners are compared as casters see them: in f32 and in the [`UnitFrame`]. Vertices at the same
/// position are the same corner, because CAD files often repeat vertices for each face.
#[must_use]
pub fn triangle_stats(mesh: &TriangleMesh) -> TriangleStats {
    let named = named_vertices(mesh);
    let positions = rounded_positions(mesh, &named);
    let keys: Vec<[u32; 3]> = positions.iter().map(|position| key(*position)).collect();
    let corner_ids = lowest_equal(&keys);

    let mut solid = Vec::with_capacity(mesh.triangles.len());
    for (index, corners) in mesh.triangles.iter().enumerate() {
        if has_area(corners.map(|corner| positions[corner as usize])) {
            solid.push(index as u32);
        }
    }

    let sorted_corners = solid.iter().map(|&index| {
        let mut ids = mesh.triangles[index as usize].map(|corner| corner_ids[corner as usize]);
        ids.sort_unstable();
        ids
    });
    let firsts = lowest_equal(&sorted_corners.collect::<Vec<_>>());
    let is_first = |(nth, index): (usize, &u32)| (firsts[nth] as usize == nth).then_some(*index);
    let kept: Vec<u32> = solid.iter().enumerate().filter_map(is_first).collect();
    let defects = MeshDefects {
        degenerate: mesh.triangles.len() - solid.len(),
        duplicate: solid.len() - kept.len(),
        unreferenced: named.iter().filter(|named| !**named).count(),
    };
    TriangleStats { defects, kept }
}

/// The vertices in f32, in the unit frame of those that are `named`; the others at the origin.
fn rounded_positions(mesh: &TriangleMesh, named: &[bool]) -> Vec<Vec3> {
    let vertices = || mesh.vertices.iter().copied().zip(named);
    let frame =
        UnitFrame::around(vertices().filter(|(_, named)| **named).map(|(vertex, _)| vertex));
    let rounded = |vertex| frame.to_unit(vertex).as_vec3();
    vertices().map(|(vertex, &named)| if named { rounded(vertex) } else { Vec3::ZERO }).collect()
}

/// Whether the cross product of two edges, in f64, is not zero.
fn has_area(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    (b - a).cross(c - a) != DVec3::ZERO
}

/// Three words that are equal if and only if positions are equal: -0 counts as 0.
fn key(position: Vec3) -> [u32; 3] {
    position.to_array().map(|coordinate| (coordinate + 0.0).to_bits())
}

/// The index of the first equal item, for each item.
fn lowest_equal(items: &[[u32; 3]]) -> Vec<u32> {
    // A table of indices takes a third of the memory of a map of the items.
    let mut firsts = HashTable::with_capacity(items.len());
    let hasher = DefaultHashBuilder::default();
    let hash = |item: &[u32; 3]| hasher.hash_one(item);
    let first_equal = |(index, item): (u32, &[u32; 3])| {
        let equals = |&first: &u32| items[first as usize] == *item;
        let rehash = |&first: &u32| hash(&items[first as usize]);
        *firsts.entry(hash(item), equals, rehash).or_insert(index).get()
    };
    (0..).zip(items).map(first_equal).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> TriangleMesh {
        let vertices = vertices.iter().copied().map(DVec3::from_array).collect();
        TriangleMesh { vertices, triangles: triangles.to_vec() }
    }

    const SQUARE: [[f64; 3]; 4] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn a_clean_mesh_is_kept_whole() {
        let stats = triangle_stats(&mesh(&SQUARE, &[[0, 1, 2], [0, 2, 3]]));
        assert_eq!(stats, TriangleStats { defects: MeshDefects::default(), kept: vec![0, 1] });
    }

    #[test]
    fn a_triangle_in_any_order_is_a_duplicate_and_the_first_is_kept() {
        let triangles = [[0, 2, 3], [2, 1, 0], [0, 1, 2], [1, 2, 0], [3, 2, 0]];
        let stats = triangle_stats(&mesh(&SQUARE, &triangles));
        assert_eq!(stats.defects.duplicate, 3);
        assert_eq!(stats.kept, [0, 1]);
    }

    #[test]
    fn positions_count_not_indices() {
        let mut vertices = SQUARE.to_vec();
        // The first three again, one with a zero of the other sign.
        vertices.extend([[-0.0, 0.0, -0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]);
        let stats = triangle_stats(&mesh(&vertices, &[[0, 1, 2], [6, 5, 4], [0, 4, 1], [3, 0, 2]]));
        assert_eq!(stats.defects, MeshDefects { degenerate: 1, duplicate: 1, unreferenced: 0 });
        assert_eq!(stats.kept, [0, 3]);
    }

    #[test]
    fn a_triangle_without_area_in_f32_is_degenerate() {
        let mut vertices = SQUARE.to_vec();
        // On a side; and off a corner by less than f32 resolves, which is 2^-25 for
        // coordinates just below 1 (here half the side is 0.5, so that it becomes 1).
        vertices.extend([[0.5, 0.0, 0.0], [1.0 - 1e-9, 1.0, 0.0]]);
        let triangles = [[0, 4, 1], [0, 2, 5], [0, 1, 1], [0, 1, 2], [0, 4, 2]];
        let stats = triangle_stats(&mesh(&vertices, &triangles));
        assert_eq!(stats.defects, MeshDefects { degenerate: 3, duplicate: 0, unreferenced: 1 });
        assert_eq!(stats.kept, [3, 4]);
    }

    #[test]
    fn a_mesh_far_away_is_counted_as_if_it_were_here() {
        let far = SQUARE.map(|position| position.map(|coordinate| coordinate + 1e7));
        let stats = triangle_stats(&mesh(&far, &[[0, 1, 2], [0, 2, 3]]));
        assert_eq!(stats.defects, MeshDefects::default());
    }

    #[test]
    fn size_does_not_matter() {
        for size in [1e-310, 1e-300, 1e-6, 1.7e12, 1e300, 1.7e308] {
            let scaled = SQUARE.map(|position| position.map(|coordinate| coordinate * size));
            let stats =
                triangle_stats(&mesh(&scaled, &[[0, 1, 2], [2, 1, 0], [0, 1, 1], [0, 2, 3]]));
            assert_eq!(stats.defects, MeshDefects { degenerate: 1, duplicate: 1, unreferenced: 0 });
            assert_eq!(stats.kept, [0, 3], "{size}");
        }
    }

    #[test]
    fn a_stray_vertex_is_counted_and_changes_nothing_else() {
        let mut vertices = SQUARE.to_vec();
        vertices.push([1e300, 0.0, 0.0]);
        let stats = triangle_stats(&mesh(&vertices, &[[0, 1, 2], [0, 2, 3]]));
        assert_eq!(stats.defects, MeshDefects { unreferenced: 1, ..MeshDefects::default() });
        assert_eq!(stats.kept, [0, 1]);
    }
}
