use crate::objects::plant::uneven::{Ripple, warped_box};
use crate::primitives::{Builder, DAffine3, DVec3, Sampler, block, dvec3};

struct Masonry {
    thick_m: f64,
    /// How far stones stand out; 0 for plaster and concrete.
    rough_m: f64,
    /// How far the coping stands out; 0 without a coping.
    coping_m: f64,
    /// The distance between piers; `None` without piers.
    piers_m: Option<f64>,
}

/// Builds a wall along y, with piers, in steps, or around a corner.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let long_m = s.log_uniform(1.0, 15.0);
    let high_m = s.log_uniform(0.5, 4.0);
    let masonry = Masonry {
        thick_m: s.uniform(0.1, 0.45),
        rough_m: if s.chance(0.25) { s.uniform(0.01, 0.03) } else { 0.0 },
        coping_m: if s.chance(0.4) { s.uniform(0.02, 0.08) } else { 0.0 },
        piers_m: if s.chance(0.35) { Some(s.uniform(1.8, 4.0)) } else { None },
    };
    // A wall on a slope descends in steps.
    let n_steps = if long_m > 3.0 { s.weighted(&[(4, 1), (1, 2), (1, 4)]) } else { 1 };
    let step_m = s.uniform(0.1, 0.4) * high_m / n_steps as f64;
    for step in 0..n_steps {
        let share_m = long_m / n_steps as f64;
        let middle = (step as f64 + 0.5) * share_m * DVec3::Y;
        let high_m = high_m - step as f64 * step_m;
        b.shifted(middle, |b| masonry.piece(b, s, share_m, high_m));
    }
    if s.chance(0.2) {
        let side_m = s.uniform(0.5, 0.6 * long_m + 0.5);
        let turned = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        b.turned(0.5 * side_m * DVec3::NEG_X, turned, |b| masonry.piece(b, s, side_m, high_m));
    }
}

impl Masonry {
    /// Adds `long_m` of wall along y about the origin.
    fn piece(&self, b: &mut Builder, s: &mut Sampler, long_m: f64, high_m: f64) {
        let size = dvec3(self.thick_m, long_m, high_m);
        if self.rough_m > 0.0 {
            let stones = Ripple::draw(s, 0.4, self.rough_m);
            let out = |p: DVec3| p + stones.at(p) * p.with_z(0.0).normalize_or(DVec3::X);
            // Larger faces suffice for a long wall, which is seen from afar.
            warped_box(b, size, 0.3_f64.max(long_m / 25.0), out);
        } else {
            block(b, 0.5 * size * DVec3::Z, size);
        }
        if self.coping_m > 0.0 {
            let coping = dvec3(self.thick_m + 2.0 * self.coping_m, long_m, 0.08);
            block(b, (high_m + 0.04) * DVec3::Z, coping);
        }
        let Some(apart_m) = self.piers_m else { return };
        let n = (long_m / apart_m).round().max(1.0);
        let pier = dvec3(self.thick_m + 0.15, self.thick_m + 0.12, high_m + 0.12);
        for k in 0..=n as usize {
            let y = (k as f64 / n - 0.5) * long_m;
            block(b, dvec3(0.0, y, 0.5 * pier.z), pier);
        }
    }
}
