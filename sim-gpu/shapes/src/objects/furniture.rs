//! What stands in rooms, at its real size.

pub mod cabinet;
pub mod door;
pub mod shelf;
pub mod sofa;

use std::f64::consts::FRAC_PI_2;

use glam::{DAffine3, DVec3};

use sim_gpu::mesh::Mesh;

use crate::primitives::{Builder, Make, Sampler};

/// Builds a chair that looks to +x.
///
/// The chairs of the ten classes have their real size: seats 0.34 to 0.52 m up,
/// bar stools 0.6 to 0.8 m (EN 1729 and EN 16139 have most of them at 0.43 m).
pub fn chair(b: &mut Builder, s: &mut Sampler) {
    b.place(DAffine3::from_rotation_z(FRAC_PI_2), |b| {
        // Few are so low or so high that they would be toys or ladders.
        scaled(b, s, crate::chair::build, |drawn_m| drawn_m.clamp(0.65, 1.4));
    });
}

/// Builds a table.
///
/// The tables of the ten classes are given a height in use: 0.70 to 0.76 m to
/// sit at (EN 527-1, EN 1729), 0.4 to 0.5 m beside a sofa, 1.05 to 1.15 m to
/// stand at.
pub fn table(b: &mut Builder, s: &mut Sampler) {
    let ranges = [(6, [0.7, 0.76]), (2, [0.4, 0.5]), (1, [1.05, 1.15])];
    let [low_m, high_m] = s.weighted(&ranges);
    let height_m = s.uniform(low_m, high_m);
    scaled(b, s, crate::table::build, |_| height_m);
}

/// Builds what stands on height 0, stretched upwards to the height that
/// `height_m` makes of the one drawn.
fn scaled(b: &mut Builder, s: &mut Sampler, build: Make, height_m: impl Fn(f64) -> f64) {
    // It is built twice, the first time to learn its height.
    let mut start = s.clone();
    let mut trial = b.clone();
    let mesh = loop {
        build(&mut trial, s);
        if is_sound(trial.mesh()) {
            break trial.mesh();
        }
        // The soft edges of thin arms leave triangles without area.
        start = s.clone();
        trial = b.clone();
    };
    let drawn_m = mesh.vertices.iter().map(|v| v.z).fold(0.0, f64::max);
    let stretch = DVec3::new(1.0, 1.0, height_m(drawn_m) / drawn_m);
    b.place(DAffine3::from_scale(stretch), |b| build(b, &mut start));
}

/// Whether all triangles have an area.
fn is_sound(mesh: &Mesh) -> bool {
    mesh.triangles.iter().all(|triangle| {
        let [p, q, r] = triangle.map(|vertex| mesh.vertices[vertex as usize]);
        (q - p).cross(r - p).length() > 1e-9
    })
}
