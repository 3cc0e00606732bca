use std::f64::consts::{FRAC_PI_2, TAU};

use crate::primitives::{Builder, DAffine3, DVec2, DVec3, Profile, Section, dvec3, smooth_tube};

#[derive(Clone, Copy, PartialEq)]
pub enum Filling {
    /// The number of spokes, and their width in metres.
    Spokes(usize, f64),
    Disc,
}

/// A wheel that stands on the ground, with its axle at `axle` along y: a tyre of `width_m`, and its
/// filling.
pub fn wheel(b: &mut Builder, axle: DVec3, width_m: f64, filling: Filling) {
    let [outer_m, half_m] = [axle.z, 0.5 * width_m];
    let rim_m = outer_m - 1.1 * width_m.max(0.035);
    let tyre = Profile::from(rim_m, -0.7 * half_m)
        .line(outer_m - 0.5 * half_m, -half_m)
        .line(outer_m, 0.0)
        .line(outer_m - 0.5 * half_m, half_m)
        .line(rim_m, 0.7 * half_m)
        .line(rim_m, -0.7 * half_m);
    b.turned(axle, DAffine3::from_rotation_x(-FRAC_PI_2), |b| {
        tyre.revolve(b, Section::Round);
        match filling {
            Filling::Disc => {
                Profile::from(0.0, 0.3 * half_m).line(rim_m, 0.0).revolve(b, Section::Round);
            }
            Filling::Spokes(n, spoke_m) => {
                let hub_m = 0.1 * rim_m;
                Profile::from(hub_m, -half_m).line(hub_m, half_m).revolve(b, Section::Polygon(6));
                for k in 0..n {
                    let out = DVec2::from_angle(k as f64 / n as f64 * TAU);
                    let aside = 0.5 * spoke_m * out.perp();
                    let at = |r: f64, side: f64| (out * r + side * aside).extend(0.0);
                    b.grid(
                        &[
                            vec![at(hub_m, -1.0), at(rim_m, -1.0)],
                            vec![at(hub_m, 1.0), at(rim_m, 1.0)],
                        ],
                        false,
                    );
                }
            }
        }
    });
}

/// A mudguard around the upper part of a wheel, between two angles (0 is forward, 90 up).
pub fn mudguard(b: &mut Builder, axle: DVec3, width_m: f64, [from_deg, to_deg]: [f64; 2]) {
    let radius_m = axle.z + 0.02;
    b.surface([6, 1], |u, v| {
        let angle_rad = (from_deg + u * (to_deg - from_deg)).to_radians();
        let out = DVec2::from_angle(angle_rad) * radius_m;
        axle + dvec3(out.x, (v - 0.5) * width_m, out.y)
    });
}

/// A handlebar through the left `grip` and its mirror image, fixed at `stem`.
pub fn handlebar(b: &mut Builder, stem: DVec3, grip: DVec3, radius_m: f64) {
    let mirror = dvec3(1.0, -1.0, 1.0);
    let bend = dvec3(0.5 * (stem.x + grip.x) + 0.03, 0.55 * grip.y, grip.z);
    smooth_tube(b, &[grip * mirror, bend * mirror, stem, bend, grip], 1, radius_m);
}
