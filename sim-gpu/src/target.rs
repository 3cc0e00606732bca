//! A mesh made ready for casting.

use crate::bvh::{Builder, Bvh};
use crate::mesh::frame::{Normalize, to_world};
use crate::mesh::validate::triangle_stats;
use crate::mesh::{Mesh, MeshError, load};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;

/// Maps an object to its unit frame: box centre to 0, half the longest side to
/// (0.5, 1]. The scale is a power of two, so that it rounds nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitFrame {
    /// The centre of the bounding box, in the object's units.
    pub centre: DVec3,
    /// Object units per unit length; a power of two.
    pub scale: f64,
}

impl UnitFrame {
    /// The frame of these vertices; the identity if there are none.
    #[must_use]
    pub fn of(vertices: impl Iterator<Item = DVec3>) -> Self {
        let infinite = DVec3::splat(f64::INFINITY);
        let (low, high) =
            vertices.fold((infinite, -infinite), |(low, high), v| (low.min(v), high.max(v)));
        if low.x > high.x {
            return Self { centre: DVec3::ZERO, scale: 1.0 };
        }
        // Halved before they are added: the sum of two huge values overflows.
        let half_size = high * 0.5 - low * 0.5;
        Self { centre: low + half_size, scale: power_of_two_above(half_size.max_element()) }
    }

    /// From the object's frame.
    #[must_use]
    pub fn to_unit(&self, point: DVec3) -> DVec3 {
        (point - self.centre) / self.scale
    }
}

/// The least power of two that is not below `x`, or the largest that f64 has;
/// 1 for zero.
fn power_of_two_above(x: f64) -> f64 {
    const LARGEST: f64 = f64::from_bits(0x7FE << 52);
    if x.is_nan() || x < f64::MIN_POSITIVE {
        return 1.0;
    }
    let floor = f64::from_bits(x.to_bits() & (0x7FF << 52));
    if floor == x { floor } else { (floor * 2.0).min(LARGEST) }
}

/// The surface of a mesh in its unit frame, in f64.
#[derive(Clone, Debug)]
pub struct Surface {
    /// How the object's frame maps to the unit frame.
    pub frame: UnitFrame,
    /// Radius of a sphere around the unit frame's origin that holds every
    /// triangle, with room for the caster's rounding.
    pub radius: f64,
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    kept: Vec<u32>,
}

/// A mesh made ready for casting: its surface for ranges, and a hierarchy over
/// it in f32 for finding them. A clone shares both.
#[derive(Clone, Debug)]
pub struct Target {
    /// The surface, in f64.
    pub surface: Arc<Surface>,
    /// The hierarchy that casters traverse.
    pub bvh: Arc<Bvh>,
}

impl Surface {
    /// The triangles of `mesh` that a ray can meet: all that are neither
    /// degenerate nor duplicates.
    #[must_use]
    pub fn of_mesh(mesh: Mesh) -> Self {
        let kept = triangle_stats(&mesh).kept;
        Self::new(mesh, kept)
    }

    /// The triangles of `mesh` whose indices `kept` lists, ascending;
    /// `mesh::validate::triangle_stats` lists those that are neither degenerate nor
    /// duplicates.
    #[must_use]
    pub fn new(mesh: Mesh, kept: Vec<u32>) -> Self {
        let used = kept
            .iter()
            .flat_map(|&t| mesh.triangles[t as usize])
            .map(|v| mesh.vertices[v as usize]);
        let frame = UnitFrame::of(used.clone());
        let farthest = used.map(|v| frame.to_unit(v).length_squared()).fold(0.0, f64::max).sqrt();
        let mut vertices = mesh.vertices;
        vertices.iter_mut().for_each(|v| *v = frame.to_unit(*v));
        // The sphere must hold the padded boxes' contents as the caster rounds
        // them: 2^-18 per axis (`bvh::BOX_PADDING`), times sqrt(3).
        let radius = farthest + 1e-5;
        Self { frame, radius, vertices, triangles: mesh.triangles, kept }
    }

    /// The corners of triangle `index` of the mesh, in the unit frame.
    #[must_use]
    pub fn corners(&self, index: u32) -> [DVec3; 3] {
        self.triangles[index as usize].map(|v| self.vertices[v as usize])
    }

    /// The indices of the triangles that a ray can meet, ascending.
    #[must_use]
    pub fn kept(&self) -> &[u32] {
        &self.kept
    }

    /// How many triangles a ray can meet.
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
    /// Reads the mesh at `path`, turns it z up as its format has it, scales it
    /// as `normalize` says, and makes it ready for casting.
    ///
    /// # Errors
    /// As [`load`].
    pub fn load(path: &Path, normalize: Normalize) -> Result<Self, MeshError> {
        let loaded = load(path)?;
        let world = to_world(&loaded.mesh, loaded.format.default_up(), normalize);
        Ok(Self::new(Surface::of_mesh(world.mesh), Builder::Sah))
    }

    /// Builds the hierarchy over `surface`.
    #[must_use]
    pub fn new(surface: Surface, builder: Builder) -> Self {
        let rounded: Vec<[f32; 3]> =
            surface.vertices.iter().map(|v| v.as_vec3().to_array()).collect();
        let corners: Vec<[[f32; 3]; 3]> = surface
            .kept
            .iter()
            .map(|&t| surface.triangles[t as usize].map(|v| rounded[v as usize]))
            .collect();
        let bvh = Bvh::build(builder, &corners, &surface.kept);
        Self { surface: Arc::new(surface), bvh: Arc::new(bvh) }
    }

    /// Bytes held, for memory budgets.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let Surface { vertices, triangles, kept, .. } = &*self.surface;
        self.bvh.bytes()
            + size_of_val(&vertices[..])
            + size_of_val(&triangles[..])
            + size_of_val(&kept[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_frame_scales_by_powers_of_two_only() {
        for (half, scale) in [(1.0, 1.0), (0.75, 1.0), (1.01, 2.0), (1e-300, 0.0), (1.7e12, 0.0)] {
            let frame = UnitFrame::of([DVec3::splat(-half), DVec3::splat(half)].into_iter());
            let unit = frame.to_unit(DVec3::splat(half)).x;
            assert!(unit > 0.5 && unit <= 1.0, "{half} maps to {unit}");
            assert_eq!(frame.scale.to_bits() << 12, 0, "{} is a power of two", frame.scale);
            assert!(scale == 0.0 || frame.scale == scale);
        }
    }

    #[test]
    fn a_huge_box_does_not_overflow() {
        let frame = UnitFrame::of([DVec3::splat(-1e308), DVec3::splat(1e308)].into_iter());
        assert!(frame.centre.is_finite() && frame.scale.is_finite());
    }
}
