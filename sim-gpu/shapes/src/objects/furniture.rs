pub mod cabinet;
pub mod door;
pub mod shelf;
pub mod sofa;

use std::f64::consts::FRAC_PI_2;

use edgepuck_mesh::TriangleMesh;

use crate::primitives::{Builder, DAffine3, Make, Sampler, dvec3};

/// Builds a chair that faces +x.
///
/// The chairs of the ten classes have real sizes: seats at 0.34 to 0.52 m, bar stools at 0.6 to 0.8
/// m (EN 1729 and EN 16139: most at 0.43 m).
pub fn chair(b: &mut Builder, s: &mut Sampler) {
    b.place(DAffine3::from_rotation_z(FRAC_PI_2), |b| {
        // The limits exclude toys and ladders.
        scaled(b, s, crate::chair::build, |drawn_m| drawn_m.clamp(0.65, 1.4));
    });
}

/// Builds a table.
///
/// Tables of the ten classes are scaled to usual heights: 0.70 to 0.76 m for sitting (EN 527-1, EN
/// 1729), 0.4 to 0.5 m beside a sofa, 1.05 to 1.15 m for standing.
pub fn table(b: &mut Builder, s: &mut Sampler) {
    let ranges = [(6, [0.7, 0.76]), (2, [0.4, 0.5]), (1, [1.05, 1.15])];
    let [low_m, high_m] = s.weighted(&ranges);
    let height_m = s.uniform(low_m, high_m);
    scaled(b, s, crate::table::build, |_| height_m);
}

/// Builds furniture on height 0 and stretches it upwards. `height_m` returns the new height for the
/// drawn one.
fn scaled(b: &mut Builder, s: &mut Sampler, build: Make, height_m: impl Fn(f64) -> f64) {
    // The first build gives the drawn height.
    let mut start = s.clone();
    let mut trial = b.clone();
    let mesh = loop {
        build(&mut trial, s);
        if is_sound(trial.mesh()) {
            break trial.mesh();
        }
        // Rounded edges of thin arms can have triangles without area; such a draw is rejected.
        start = s.clone();
        trial = b.clone();
    };
    let drawn_m = mesh.vertices.iter().map(|v| v.z).fold(0.0, f64::max);
    let stretch = dvec3(1.0, 1.0, height_m(drawn_m) / drawn_m);
    b.place(DAffine3::from_scale(stretch), |b| build(b, &mut start));
}

/// Whether all triangles have an area.
fn is_sound(mesh: &TriangleMesh) -> bool {
    mesh.triangles.iter().all(|triangle| {
        let [p, q, r] = triangle.map(|vertex| mesh.vertices[vertex as usize]);
        (q - p).cross(r - p).length() > 1e-9
    })
}
