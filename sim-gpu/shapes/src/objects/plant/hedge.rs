use super::foliage::{blade, leaf, leaf_length_m};
use super::uneven::{BoxFace, Ripple, warped_box};
use crate::primitives::{Builder, DVec3, Sampler, dvec3};

/// A piece of hedge without a gap, which stands on the ground along x.
struct Piece {
    size_m: DVec3,
    /// The width at the top over that at the ground.
    taper: f64,
    /// How far the edges of the top are below its middle, over the height.
    round: f64,
    ripple: Ripple,
}

pub fn build(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.log_uniform(0.8, 2.5);
    let wide_m = s.uniform(0.35, 1.4);
    let long_m = s.log_uniform(1.0, 8.0);
    let n = if long_m > 2.0 { s.weighted(&[(3, 1), (1, 2), (1, 3)]) } else { 1 };
    let taper = s.uniform(0.65, 1.05);
    let round = s.pick(&[0.0, 0.0, 0.1, 0.35]);
    let rough_m = s.log_uniform(0.008, 0.07);
    let plant = s.pick(&[dense, dense, smooth, loose]);
    let mut x = 0.0;
    for _ in 0..n {
        let share_m = long_m / n as f64 * s.uniform(0.85, 1.0);
        let size_m = dvec3(share_m, wide_m, height_m * s.uniform(0.93, 1.0));
        let ripple = Ripple::draw(s, 0.6, rough_m);
        let middle = dvec3(x + 0.5 * share_m, s.uniform(-0.05, 0.05), 0.0);
        b.shifted(middle, |b| plant(b, s, &Piece { size_m, taper, round, ripple }));
        x += share_m + s.pick(&[0.1, 0.3, 0.8]);
    }
}

impl Piece {
    /// Moves a point of the box to its place in the hedge.
    fn warp(&self, p: DVec3) -> DVec3 {
        let across = 2.0 * p.y / self.size_m.y;
        let narrow = 1.0 - (1.0 - self.taper) * p.z / self.size_m.z;
        let z = p.z * (1.0 - self.round * across.powi(4));
        let bent = dvec3(p.x, p.y * narrow, z);
        let out = (bent - 0.5 * self.size_m.z * DVec3::Z).normalize_or(DVec3::Z);
        let moved = bent + self.ripple.at(bent) * out;
        moved.with_z(moved.z.max(0.0))
    }

    /// Adds leaves to the faces, up to `deep_m` deep and `layers` thick, at the places where
    /// `grows` is true.
    fn leaves(
        &self,
        b: &mut Builder,
        s: &mut Sampler,
        [deep_m, layers]: [f64; 2],
        grows: impl Fn(DVec3) -> bool,
    ) {
        let area = |face: BoxFace| face.size_m(self.size_m).iter().product::<f64>();
        let area_m2: f64 = BoxFace::SEEN.map(area).iter().sum();
        let n = (150.0 * area_m2).clamp(600.0, 1400.0);
        let length_m = leaf_length_m(n as usize, area_m2, layers);
        for face in BoxFace::SEEN {
            for _ in 0..(n * area(face) / area_m2).round() as usize {
                let flat = face.at(self.size_m, s.uniform(0.0, 1.0), s.uniform(0.0, 1.0));
                // Leaves reach half their length out of the face.
                let inner_m = (self.size_m - 2.0 * s.uniform(0.0, deep_m)).max(0.2 * self.size_m);
                let at = self.warp(flat * inner_m / self.size_m);
                if grows(at) {
                    leaf(b, s, at.with_z(at.z.max(0.04)), length_m);
                }
            }
        }
    }
}

/// Leaves on an opaque body.
fn dense(b: &mut Builder, s: &mut Sampler, piece: &Piece) {
    warped_box(b, piece.size_m, 0.3, |p| piece.warp(p * dvec3(0.97, 0.85, 0.95)));
    let layers = s.uniform(0.3, 0.7);
    piece.leaves(b, s, [0.1, layers], |_| true);
}

/// A smooth opaque body: box or yew.
fn smooth(b: &mut Builder, _: &mut Sampler, piece: &Piece) {
    warped_box(b, piece.size_m, 0.25, |p| piece.warp(p));
}

/// Leaves with holes that beams pass, above visible stems.
fn loose(b: &mut Builder, s: &mut Sampler, piece: &Piece) {
    let holes = Ripple::draw(s, 0.7, 1.0);
    let most = s.uniform(0.6, 2.0);
    let clear_m = piece.size_m.z * s.uniform(0.0, 0.25);
    let layers = s.uniform(0.8, 1.6);
    let deep_m = 0.3 * piece.size_m.y;
    piece.leaves(b, s, [deep_m, layers], |p| p.z > clear_m && holes.at(p) < most);
    let half_m = 0.5 * piece.size_m;
    for _ in 0..(8.0 * piece.size_m.x) as usize {
        let x = s.uniform(-half_m.x, half_m.x);
        let y = 0.5 * s.uniform(-half_m.y, half_m.y);
        blade(b, dvec3(x, y, 0.0), dvec3(x + s.uniform(-0.2, 0.2), 1.5 * y, 1.6 * half_m.z), 0.05);
    }
}
