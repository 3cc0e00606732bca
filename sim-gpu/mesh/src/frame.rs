//! The transform from the axes and units of a file to the world: z up, in metres.

pub use formats::unit::Unit;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::triangle_mesh::TriangleMesh;
use super::unit_frame::bounding_box;

formats::named! {
    /// The axis of a file that points up in the world.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Up: "axis" {
        /// The y axis: (x, y, z) becomes (x, -z, y).
        Y = "y",
        /// The z axis, as in the world.
        #[default]
        Z = "z",
    }
}

formats::named! {
    /// The translation and the scale of a mesh.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Normalize: "normalization" {
        /// The mean of the vertices moves to the origin and the farthest vertex to radius 1, as in
        /// the point clouds of ModelNet.
        #[default]
        UnitSphere = "unit-sphere",
        /// The centre of the bounding box moves to the origin, and its longest side becomes 2, as
        /// in ModelNet40-C.
        Bbox = "bbox",
        /// The mesh stays where it is; the unit of the file is a metre.
        None = "none",
    }
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

/// A mesh around the origin, and its transform: `vertex = (position - centre) * scale`, where
/// `position` is that of the file, turned z up.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldMesh {
    /// The mesh, z up, in metres.
    pub mesh: TriangleMesh,
    /// The position of the origin, in the units of the file.
    pub centre: DVec3,
    /// Metres per unit of the file; at most the largest finite number.
    pub scale: f64,
}

/// Turns `mesh` z up, then moves and scales it by `normalize`. [`Normalize::None`] only moves the
/// centre of its bounding box to the origin: the caller moves it back by `centre`.
///
/// Centre and size are those of the vertices that triangles refer to. Other vertices are ignored
/// and moved to the origin. (ModelNet's files have hardly any, so that the mean is ModelNet's.) A
/// mesh without extent is only moved. Every finite coordinate is allowed: sums are relative to the
/// bounding box and in units of its largest coordinate.
#[must_use]
pub fn to_world(mesh: &TriangleMesh, up: Up, normalize: Normalize) -> WorldMesh {
    let named = named_vertices(mesh);
    let named_positions =
        || mesh.vertices.iter().zip(&named).filter(|(_, named)| **named).map(|(vertex, _)| vertex);

    let largest = named_positions().map(|vertex| vertex.abs().max_element()).fold(0.0, f64::max);
    let unit = power_of_two_near(largest);
    let (low, high) = bounding_box(named_positions().map(|vertex| z_up(*vertex, up) / unit));
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
        mesh: TriangleMesh {
            vertices: mesh.vertices.iter().zip(&named).map(moved).collect(),
            triangles: mesh.triangles.clone(),
        },
        centre: (box_centre + shift) * unit,
        scale: (size.recip() / unit).min(f64::MAX),
    }
}

/// Whether a triangle refers to each vertex, `[n_vertices]`.
pub(super) fn named_vertices(mesh: &TriangleMesh) -> Vec<bool> {
    let mut named = vec![false; mesh.vertices.len()];
    for &corner in mesh.triangles.iter().flatten() {
        named[corner as usize] = true;
    }
    named
}

/// `position` in the axes of a file whose `up` axis points up, in those of the world, z up.
#[must_use]
pub fn z_up(position: DVec3, up: Up) -> DVec3 {
    match up {
        Up::Y => DVec3::new(position.x, -position.z, position.y),
        Up::Z => position,
    }
}

/// The largest power of two up to `value` whose inverse is finite and normal too; 1 for 0.
/// Multiplication by it does not round.
fn power_of_two_near(value: f64) -> f64 {
    const EXPONENT: u64 = 0x7FF << 52;
    let power = f64::from_bits(value.to_bits() & EXPONENT);
    if value == 0.0 { 1.0 } else { power.clamp(f64::MIN_POSITIVE, f64::MIN_POSITIVE.recip()) }
}

/// The length of `v`, which may be so short that squares underflow.
fn length(v: DVec3) -> f64 {
    let longest = v.abs().max_element();
    if longest == 0.0 { 0.0 } else { (v / longest).length() * longest }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron of size `size` at `centre`, and a stray vertex.
    fn tetrahedron(size: f64, centre: DVec3) -> TriangleMesh {
        let corners = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::Y, DVec3::Z];
        let mut vertices: Vec<_> = corners.iter().map(|c| centre + size * *c).collect();
        vertices.push(DVec3::splat(-9e99));
        TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] }
    }

    /// A few roundings of coordinates of the order of 1.
    const ROUNDING: f64 = 4.0 * f64::EPSILON;

    #[test]
    fn y_up_turns_to_z_up_without_a_mirror() {
        let position = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(z_up(position, Up::Y), DVec3::new(1.0, -3.0, 2.0));
        assert_eq!(z_up(position, Up::Z), position);
        let turned = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| z_up(axis, Up::Y));
        assert_eq!(turned[0].cross(turned[1]), turned[2]);
    }

    #[test]
    fn a_unit_sphere_has_its_mean_at_0_and_radius_1() {
        let world = to_world(&tetrahedron(1.0, DVec3::ZERO), Up::Z, Normalize::UnitSphere);
        assert!(world.centre.abs_diff_eq(DVec3::new(0.25, 0.5, 0.25), ROUNDING));
        let mean: DVec3 = world.mesh.vertices[..4].iter().sum::<DVec3>() / 4.0;
        assert!(mean.length() < ROUNDING);
        let radius = world.mesh.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
        assert!((radius - 1.0).abs() < ROUNDING);
    }

    #[test]
    fn a_box_has_its_centre_at_0_and_longest_side_2() {
        let world = to_world(&tetrahedron(1.0, DVec3::ZERO), Up::Z, Normalize::Bbox);
        assert_eq!(world.centre, DVec3::new(0.5, 1.0, 0.5));
        assert_eq!(world.scale, 1.0);
        assert_eq!(world.mesh.vertices[2], DVec3::new(-0.5, 1.0, -0.5));
    }

    #[test]
    fn none_moves_only() {
        let world = to_world(&tetrahedron(4.0, DVec3::splat(8.0)), Up::Y, Normalize::None);
        assert_eq!(world.centre, DVec3::new(10.0, -10.0, 12.0));
        assert_eq!(world.scale, 1.0);
        assert_eq!(world.mesh.vertices[0], DVec3::new(-2.0, 2.0, -4.0));
    }

    #[test]
    fn the_result_is_the_same_for_every_unit() {
        for normalize in [Normalize::UnitSphere, Normalize::Bbox] {
            let plain = to_world(&tetrahedron(1.0, DVec3::ZERO), Up::Z, normalize);
            // 1.7e12 is ModelNet40's largest; the others approach the limits of f64.
            for size in [1.7e12, 1e300, 8e307, 0.03, 1e-200, 1e-300] {
                let world = to_world(&tetrahedron(size, DVec3::ZERO), Up::Z, normalize);
                for (a, b) in world.mesh.vertices.iter().zip(&plain.mesh.vertices) {
                    assert!(a.abs_diff_eq(*b, ROUNDING), "{size}: {a} is not {b}");
                }
                assert!((world.scale * size / plain.scale - 1.0).abs() < ROUNDING, "{size}");
                assert!(world.centre.is_finite());
            }
        }
    }

    #[test]
    fn a_far_centre_costs_only_the_digits_of_the_coordinates() {
        let centre = DVec3::splat(1e7);
        let far = to_world(&tetrahedron(1.0, centre), Up::Z, Normalize::UnitSphere);
        let near = to_world(&tetrahedron(1.0, DVec3::ZERO), Up::Z, Normalize::UnitSphere);
        for (a, b) in far.mesh.vertices.iter().zip(&near.mesh.vertices) {
            // 1e7 + k is exact in f64, so nothing is lost before the centring.
            assert!(a.abs_diff_eq(*b, ROUNDING), "{a} is not {b}");
        }
    }

    #[test]
    fn a_stray_vertex_goes_to_the_origin() {
        let world = to_world(&tetrahedron(1e-300, DVec3::ZERO), Up::Z, Normalize::None);
        assert_eq!(world.mesh.vertices[4], DVec3::ZERO);
    }

    #[test]
    fn a_mesh_without_extent_has_scale_1() {
        for position in [DVec3::ZERO, DVec3::splat(1e300), DVec3::splat(5e-324)] {
            let mesh = TriangleMesh { vertices: vec![position; 3], triangles: vec![[0, 1, 2]] };
            for normalize in [Normalize::UnitSphere, Normalize::Bbox, Normalize::None] {
                let world = to_world(&mesh, Up::Z, normalize);
                assert_eq!((world.scale, world.centre), (1.0, position));
                assert_eq!(world.mesh.vertices, [DVec3::ZERO; 3]);
            }
        }
    }
}
