use std::f64::consts::TAU;

use super::foliage::blade;
use super::uneven::{Ripple, direction};
use crate::primitives::{Builder, DVec2, DVec3, Sampler, cap, rod, skin};

/// The radius below which a branch is two crossed triangles.
const THIN_M: f64 = 0.03;

/// A stem that stands upright or leans.
pub struct Stem {
    foot: DVec3,
    rise: DVec3,
    /// The offset of the middle.
    bow: DVec3,
    radii_m: [f64; 2],
    /// The additional radius at the foot, over the radius above it.
    flare: f64,
    bark: Ripple,
}

impl Stem {
    /// Draws a stem from `foot` to `top`, with its radii above the roots and at the top.
    pub fn draw(s: &mut Sampler, foot: DVec3, top: DVec3, radii_m: [f64; 2]) -> Self {
        let rise = top - foot;
        let bow = s.uniform(0.0, 0.04) * rise.length() * direction(s).with_z(0.0);
        let rooted = foot.z == 0.0;
        let flare = if rooted { s.uniform(0.05, 0.8) } else { 0.0 };
        let rough = s.uniform(0.01, 0.06);
        let bark = Ripple::draw(s, 1.5 * radii_m[0], rough * radii_m[0]);
        Self { foot, rise, bow, radii_m, flare, bark }
    }

    /// The middle of the stem at this share of its length.
    pub fn at(&self, share: f64) -> DVec3 {
        self.foot + share * self.rise + 4.0 * share * (1.0 - share) * self.bow
    }

    /// The share of the length at which the stem reaches the height `z`.
    pub fn share_at(&self, z: f64) -> f64 {
        ((z - self.foot.z) / self.rise.z).clamp(0.0, 1.0)
    }

    /// The radius at a share of the length. The roots widen the stem up to about one and a half
    /// radii above the ground.
    pub fn radius_m(&self, share: f64) -> f64 {
        let [low_m, high_m] = self.radii_m;
        let height = share * self.rise.z / (0.8 * low_m);
        low_m + share * (high_m - low_m) + self.flare * low_m * libm::exp(-height)
    }

    /// A point of the bark, at an angle about the stem.
    pub fn bark(&self, share: f64, angle_rad: f64) -> DVec3 {
        let out = DVec2::from_angle(angle_rad).extend(0.0);
        let point = self.at(share) + self.radius_m(share) * out;
        point + self.bark.at(point) * out
    }

    pub fn build(&self, b: &mut Builder) {
        let n_around = b.around(self.radii_m[0], 7);
        let n_along = (self.rise.z / 0.25).clamp(4.0, 14.0) as usize;
        let section = |share: f64| -> Vec<DVec3> {
            let angle_rad = |i: usize| i as f64 / n_around as f64 * TAU;
            (0..n_around).map(|i| self.bark(share, angle_rad(i))).collect()
        };
        // Sections are closer near the roots, which spread.
        let sections: Vec<_> =
            (0..=n_along).map(|j| section(libm::pow(j as f64 / n_along as f64, 1.5))).collect();
        skin(b, &sections);
        cap(b, &sections[n_along]);
    }
}

/// Adds a branch, thinner towards its end, that bends upwards or sags.
pub fn bough(b: &mut Builder, from: DVec3, to: DVec3, radius_m: f64, sag: f64) {
    let middle = from.lerp(to, 0.5) - sag * from.distance(to) * DVec3::Z;
    rod(b, from, middle, [radius_m, 0.75 * radius_m]);
    rod(b, middle, to, [0.75 * radius_m, 0.4 * radius_m]);
}

/// A branch of a bare tree.
pub struct Branch {
    /// The place where it leaves its parent.
    pub from: DVec3,
    /// Its direction times its length.
    pub along: DVec3,
    pub radius_m: f64,
}

impl Branch {
    /// Adds the branch and `orders` generations of smaller branches along it.
    pub fn grow(&self, b: &mut Builder, s: &mut Sampler, orders: usize) {
        let end = self.from + self.along;
        if self.radius_m > THIN_M {
            rod(b, self.from, end, [self.radius_m, 0.6 * self.radius_m]);
        } else {
            blade(b, self.from, end, 2.0 * self.radius_m);
        }
        if orders == 0 {
            return;
        }
        let length_m = self.along.length();
        for child in 0..4 {
            // The last child continues from the end.
            let share = if child == 3 { 1.0 } else { s.uniform(0.3, 1.0) };
            let turned = self.along / length_m + s.uniform(0.4, 0.9) * direction(s);
            let upwards = (turned + 0.15 * DVec3::Z).normalize_or(DVec3::Z);
            let along = length_m * s.uniform(0.45, 0.8) * upwards;
            let radius_m = (self.radius_m * s.uniform(0.45, 0.7)).max(0.008);
            Self { from: self.from + share * self.along, along, radius_m }.grow(b, s, orders - 1);
        }
    }
}
