//! The last touches: budget, pose, and the disorder of real CAD.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use glam::{DQuat, DVec3};

use super::class::ShapeClass;
use crate::primitives::{Builder, Sampler};
use sim_gpu::mesh::Mesh;

/// The fewest triangles of a shape.
pub const MIN_TRIANGLES: usize = 200;
/// The most triangles of a shape.
const MAX_TRIANGLES: usize = 50_000;
/// Coordinates are multiples of this: a micrometre.
const STEPS_PER_METRE: f64 = 1e6;

/// What is decided about an instance besides its form.
#[derive(Clone, Debug)]
pub struct Finish {
    /// Triangles wanted before any are doubled.
    pub target_triangles: usize,
    /// Edge length of flat surfaces over that of curved ones.
    pub flat_ratio: f64,
    yaw_rad: f64,
    winding: Winding,
    doubled_share: f64,
    vertices: Vertices,
}

/// Which way triangles look.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Winding {
    AsBuilt,
    Inverted,
    SomePartsInverted,
    SomeTrianglesInverted,
}

/// How corners share vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Vertices {
    SharedWithinParts,
    Merged,
    EachCornerItsOwn,
}

impl Finish {
    /// Draws a finish. The shares are near those counted in 21 ModelNet
    /// meshes: two in three have some doubled faces, one in seven all; nearly
    /// all have inconsistent winding.
    pub fn draw(class: ShapeClass, s: &mut Sampler) -> Self {
        use Vertices::{EachCornerItsOwn, Merged, SharedWithinParts};
        use Winding::{AsBuilt, Inverted, SomePartsInverted, SomeTrianglesInverted};
        let doubled_share = s.pick(&[0.0, 0.0, 0.0, 0.05, 0.2, 0.5, 1.0]);
        let wanted = s.log_uniform(1.1 * MIN_TRIANGLES as f64, MAX_TRIANGLES as f64);
        let turned = s.chance(class.turn_chance());
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

    /// Poses what was built and wears it.
    pub fn apply(&self, builder: Builder, s: &mut Sampler) -> Mesh {
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

    /// Turns the shape, stands it on z = 0 and rounds to the micrometre.
    fn pose(&self, mesh: &mut Mesh) {
        let yaw = DQuat::from_rotation_z(self.yaw_rad);
        let lowest_m = mesh.vertices.iter().map(|v| v.z).fold(f64::INFINITY, f64::min);
        for vertex in &mut mesh.vertices {
            let stood = yaw * *vertex - lowest_m * DVec3::Z;
            // Adding 0 turns -0 into 0, which text would tell apart.
            *vertex = (stood * STEPS_PER_METRE).round() / STEPS_PER_METRE + DVec3::ZERO;
        }
    }

    fn invert(&self, mesh: &mut Mesh, parts: &[usize], s: &mut Sampler) {
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

    /// Adds the first triangles once more, looking the other way.
    fn double(&self, mesh: &mut Mesh) {
        let n = (self.doubled_share * mesh.triangles.len() as f64).floor() as usize;
        let copies: Vec<_> = mesh.triangles[..n].iter().map(|&[a, b, c]| [a, c, b]).collect();
        mesh.triangles.extend(copies);
    }
}

/// Leaves out triangles that rounding has made a line or a point.
fn drop_slivers(mesh: &mut Mesh) {
    let vertices = &mesh.vertices;
    mesh.triangles.retain(|t| {
        let [a, b, c] = t.map(|i| vertices[i as usize]);
        // A triangle of a micrometre's height over a micrometre's base.
        (b - a).cross(c - a).length() > STEPS_PER_METRE.powi(-2)
    });
}

/// Numbers vertices by first use. Corners whose `key` (of their number, their
/// vertex, and their place in micrometres) is equal share a vertex.
fn merge(mesh: &mut Mesh, key: impl Fn(i64, i64, [i64; 3]) -> [i64; 3]) {
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
