//! Lamp shades.

use glam::DVec3;

use super::super::builder::Builder;
use super::super::primitives::revolve::{Profile, Section, ellipsoid};
use super::super::primitives::sweep::rod;
use super::super::primitives::vessel::{Vessel, Wall};
use super::super::sampler::Sampler;

/// The outline of a shade.
#[derive(Clone, Copy)]
enum Cut {
    Frustum,
    Bell,
    Dome,
}

/// A shade that hangs from `top_m`, `high_m` tall and `radius_m` wide below,
/// with the bulb inside; most are open at both ends.
pub fn shade(b: &mut Builder, s: &mut Sampler, top_m: f64, radius_m: f64, high_m: f64) {
    let narrow_m = radius_m * s.uniform(0.35, 1.0);
    let low_m = top_m - high_m;
    let below = Profile::from(radius_m, low_m);
    let frustum = Cut::Frustum;
    let cut = s.pick(&[frustum, frustum, frustum, Cut::Bell, Cut::Dome]);
    let neck_m = match cut {
        Cut::Frustum => narrow_m,
        Cut::Bell => 0.9 * narrow_m,
        Cut::Dome => 0.1 * radius_m,
    };
    let profile = match cut {
        Cut::Bell => below.curve(&[
            (0.5 * (radius_m + narrow_m), low_m + 0.25 * high_m),
            (narrow_m, low_m + 0.7 * high_m),
            (neck_m, top_m),
        ]),
        Cut::Dome => below.curve(&[
            (0.92 * radius_m, low_m + 0.4 * high_m),
            (0.65 * radius_m, low_m + 0.77 * high_m),
            (neck_m, top_m),
        ]),
        Cut::Frustum => below.line(neck_m, top_m),
    };
    let pleats = Section::Fluted { count: s.count(16, 32), depth: 0.03 };
    let section =
        s.pick(&[Section::Round, Section::Round, Section::Round, Section::Polygon(4), pleats]);
    let thin = Wall::Solid(0.02 * radius_m);
    let wall = s.pick(&[Wall::Sheet, Wall::Sheet, thin]);
    Vessel::new(profile, wall, section).build(b);
    let bulb_m = 0.22 * narrow_m.min(high_m);
    let bulb = (low_m + 0.5 * high_m) * DVec3::Z;
    ellipsoid(b, bulb, DVec3::new(bulb_m, bulb_m, 1.4 * bulb_m));
    spider(b, bulb, top_m, 0.97 * neck_m);
}

/// Four wires at `top_m` that carry a shade, and the socket of its bulb.
fn spider(b: &mut Builder, bulb: DVec3, top_m: f64, reach_m: f64) {
    let r = 0.015 * reach_m;
    let hub = top_m * DVec3::Z;
    for out in [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y] {
        rod(b, hub, hub + reach_m * out, [r, r]);
    }
    rod(b, bulb, hub, [4.0 * r, 2.0 * r]);
}
