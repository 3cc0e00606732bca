//! Meshes prepared for casting.

use crate::bvh::{Builder, Bvh};
use edgepuck_mesh::TriangleMesh;
use edgepuck_mesh::validate::triangle_stats;
use glam::DVec3;
use std::sync::Arc;

pub use edgepuck_mesh::unit_frame::UnitFrame;

/// The surface of a mesh in its unit frame, in f64.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The map from the object's frame to the unit frame.
    pub frame: UnitFrame,
    /// The radius of a sphere around the unit frame's origin that contains every triangle, with a
    /// margin for the casters' rounding.
    pub radius: f64,
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// For each triangle, which of [`ORDERS`] sorts its corners by coordinates.
    orders: Vec<u8>,
    kept: Vec<u32>,
}

/// A mesh prepared for casting: its surface in f64 for ranges, and a hierarchy in f32 for the
/// search. A clone shares both.
#[derive(Clone, Debug)]
pub struct Target {
    /// The surface, in f64.
    pub surface: Arc<Surface>,
    /// The hierarchy that casters traverse.
    pub bvh: Arc<Bvh>,
}

impl Surface {
    /// The surface of the triangles of `mesh` that are neither degenerate nor duplicates.
    #[must_use]
    pub fn of_mesh(mesh: TriangleMesh) -> Self {
        let kept = triangle_stats(&mesh).kept;
        Self::new(mesh, kept)
    }

    /// The vertices, in the object's frame.
    #[must_use]
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// All triangles of the mesh, as indices of vertices.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The surface of the triangles of `mesh` with the indices `kept`, ascending.
    #[must_use]
    pub fn new(mesh: TriangleMesh, kept: Vec<u32>) -> Self {
        let used = kept
            .iter()
            .flat_map(|&t| mesh.triangles[t as usize])
            .map(|v| mesh.vertices[v as usize]);
        let frame = UnitFrame::around(used.clone());
        let farthest = used.map(|v| frame.to_unit(v).length_squared()).fold(0.0, f64::max).sqrt();
        let mut vertices = mesh.vertices;
        vertices.iter_mut().for_each(|v| *v = frame.to_unit(*v));
        // More than the padding of boxes, 2^-18 on each axis (`bvh::BOX_PADDING`), times sqrt(3).
        let radius = farthest + 1e-5;
        let orders = mesh.triangles.iter().map(|corners| order(corners, &vertices)).collect();
        Self { frame, radius, vertices, triangles: mesh.triangles, orders, kept }
    }

    /// The corners of triangle `index` of the mesh, in the unit frame.
    #[must_use]
    pub fn corners(&self, index: u32) -> [DVec3; 3] {
        self.triangles[index as usize].map(|v| self.vertices[v as usize])
    }

    /// As [`corners`](Self::corners), sorted by coordinates, whatever their order in the mesh.
    #[must_use]
    #[inline]
    pub(crate) fn sorted_corners(&self, index: u32) -> [DVec3; 3] {
        let corners = self.triangles[index as usize];
        let order = ORDERS[usize::from(self.orders[index as usize])];
        order.map(|nth| self.vertices[corners[nth] as usize])
    }

    /// The indices of the triangles that a ray can meet, ascending.
    #[must_use]
    pub fn kept(&self) -> &[u32] {
        &self.kept
    }

    /// The number of triangles that a ray can meet.
    #[must_use]
    pub fn len(&self) -> usize {
        self.kept.len()
    }

    /// Whether no triangle can be met.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }
}

impl Target {
    /// Builds the hierarchy over `surface`.
    #[must_use]
    pub fn new(surface: Surface, builder: Builder) -> Self {
        let bvh = Bvh::build(builder, &surface.kept, |nth| {
            surface.corners(surface.kept[nth]).map(|v| v.as_vec3().to_array())
        });
        Self { surface: Arc::new(surface), bvh: Arc::new(bvh) }
    }

    /// The bytes that it takes, for memory budgets.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let Surface { vertices, triangles, orders, kept, .. } = &*self.surface;
        self.bvh.bytes()
            + size_of_val(&vertices[..])
            + size_of_val(&triangles[..])
            + size_of_val(&orders[..])
            + size_of_val(&kept[..])
    }
}

/// The orders of three corners.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// The number of the first of [`ORDERS`] by which the coordinates of `corners` never fall.
fn order(corners: &[u32; 3], vertices: &[DVec3]) -> u8 {
    let [a, b, c] = corners.map(|v| vertices[v as usize]);
    let falls = |p: DVec3, q: DVec3| {
        let [x, y, z] = [p.x.total_cmp(&q.x), p.y.total_cmp(&q.y), p.z.total_cmp(&q.z)];
        x.then(y).then(z).is_gt()
    };
    match (falls(a, b), falls(b, c), falls(a, c)) {
        (false, false, _) => 0,
        (false, true, false) => 1,
        (true, _, false) => 2,
        (true, false, true) => 3,
        (false, true, true) => 4,
        (true, true, true) => 5,
    }
}
