//! Finishes a shape: its number of triangles, its pose, and the defects of real CAD meshes.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use glam::{DQuat, DVec3};

use super::class::{FAMILIES, ShapeClass};
use crate::primitives::{Builder, Sampler};
use edgepuck_mesh::TriangleMesh;

pub const MIN_TRIANGLES: usize = 200;
const MAX_TRIANGLES: usize = 50_000;
/// Coordinates are multiples of this: a micrometre.
const STEPS_PER_METRE: f64 = 1e6;

/// The properties of a shape apart from its form.
#[derive(Clone, Debug)]
pub struct Finish {
    /// The number of triangles before any are doubled.
    pub target_triangles: usize,
    /// The edge length of flat surfaces over that of curved ones.
    pub flat_ratio: f64,
    yaw_rad: f64,
    winding: Winding,
    doubled_share: f64,
    vertices: Vertices,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Winding {
    AsBuilt,
    Inverted,
    SomePartsInverted,
    SomeTrianglesInverted,
}

/// Which corners share a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Vertices {
    SharedWithinParts,
    Merged,
    EachCornerItsOwn,
}

impl Finish {
    /// Draws a finish. The frequencies are close to those in 21 meshes of ModelNet: two in three
    /// have some doubled faces, one in seven only doubled faces; nearly all have inconsistent
    /// winding.
    pub fn draw(class: ShapeClass, s: &mut Sampler) -> Self {
        use Vertices::{EachCornerItsOwn, Merged, SharedWithinParts};
        use Winding::{AsBuilt, Inverted, SomePartsInverted, SomeTrianglesInverted};
        let doubled_share = s.pick(&[0.0, 0.0, 0.0, 0.05, 0.2, 0.5, 1.0]);
        let wanted = s.log_uniform(1.1 * MIN_TRIANGLES as f64, MAX_TRIANGLES as f64);
        let turned = s.chance(FAMILIES[class as usize].1);
        let turns = f64::from(if turned { s.pick(&[1, 2, 2, 3]) } else { 0 });
        Self {
            target_triangles: (wanted / (1.0 + doubled_share)).floor() as usize,
            flat_ratio: s.pick(&[1.0, 2.0, 4.0]),
            yaw_rad: turns * FRAC_PI_2 + s.uniform(-15.0, 15.0).to_radians(),
            winding: s.pick(&[AsBuilt, Inverted, SomePartsInverted, SomeTrianglesInverted]),
            doubled_share,
            vertices: s.pick(&[SharedWithinParts, Merged, EachCornerItsOwn]),
        }
    }

    /// Poses the mesh of `builder` and adds the defects.
    pub fn apply(&self, builder: Builder, s: &mut Sampler) -> TriangleMesh {
        let (mut mesh, parts) = builder.finish();
        self.pose(&mut mesh);
        self.invert(&mut mesh, &parts, s);
        drop_slivers(&mut mesh);
        self.double(&mut mesh);
        match self.vertices {
            Vertices::SharedWithinParts => merge(&mut mesh, |_, vertex, _| [vertex, 0, 0]),
            Vertices::Merged => merge(&mut mesh, |_, _, place| place),
            Vertices::EachCornerItsOwn => merge(&mut mesh, |corner, _, _| [corner, 0, 0]),
        }
        mesh
    }

    /// Rotates the shape, moves it to z = 0 and rounds it to micrometres.
    fn pose(&self, mesh: &mut TriangleMesh) {
        let yaw = DQuat::from_rotation_z(self.yaw_rad);
        let lowest_m = mesh.vertices.iter().map(|v| v.z).fold(f64::INFINITY, f64::min);
        for vertex in &mut mesh.vertices {
            let stood = yaw * *vertex - lowest_m * DVec3::Z;
            // Adding 0 turns -0 into 0; text would show the sign.
            *vertex = (stood * STEPS_PER_METRE).round() / STEPS_PER_METRE + DVec3::ZERO;
        }
    }

    fn invert(&self, mesh: &mut TriangleMesh, parts: &[usize], s: &mut Sampler) {
        let ends = parts.iter().skip(1).copied().chain([mesh.triangles.len()]);
        let ranges: Vec<_> = parts.iter().copied().zip(ends).collect();
        for (start, end) in ranges {
            let part = self.winding == Winding::SomePartsInverted && s.chance(0.4);
            for triangle in &mut mesh.triangles[start..end] {
                let single = self.winding == Winding::SomeTrianglesInverted && s.chance(0.3);
                if part || single || self.winding == Winding::Inverted {
                    triangle.swap(1, 2);
                }
            }
        }
    }

    /// Adds a copy of the first triangles with the opposite winding.
    fn double(&self, mesh: &mut TriangleMesh) {
        let n = (self.doubled_share * mesh.triangles.len() as f64).floor() as usize;
        let copies: Vec<_> = mesh.triangles[..n].iter().map(|&[a, b, c]| [a, c, b]).collect();
        mesh.triangles.extend(copies);
    }
}

/// Removes triangles that rounding has reduced to a line or a point.
fn drop_slivers(mesh: &mut TriangleMesh) {
    let vertices = &mesh.vertices;
    mesh.triangles.retain(|t| {
        let [a, b, c] = t.map(|i| vertices[i as usize]);
        // Twice the area of a triangle with a base and a height of a micrometre.
        (b - a).cross(c - a).length() > STEPS_PER_METRE.powi(-2)
    });
}

/// Numbers the vertices in the order of their first use. Corners with equal keys share a vertex;
/// the arguments of `key` are the number of the corner, its vertex, and its place in micrometres.
fn merge(mesh: &mut TriangleMesh, key: impl Fn(i64, i64, [i64; 3]) -> [i64; 3]) {
    let mut numbers = BTreeMap::new();
    let mut vertices = Vec::new();
    for (corner, number_of_corner) in mesh.triangles.as_flattened_mut().iter_mut().zip(0..) {
        let vertex = mesh.vertices[*corner as usize];
        let place = (vertex * STEPS_PER_METRE).round().to_array().map(|c| c as i64);
        let key = key(number_of_corner, i64::from(*corner), place);
        let number = numbers.entry(key).or_insert_with(|| {
            vertices.push(vertex);
            vertices.len() as u32 - 1
        });
        *corner = *number;
    }
    mesh.vertices = vertices;
}
