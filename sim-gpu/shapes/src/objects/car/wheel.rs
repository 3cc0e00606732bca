//! Wheels of cars, lorries and buses.

use std::f64::consts::FRAC_PI_2;

use glam::DAffine3;

use crate::primitives::{Builder, Profile, Section};

/// A wheel on an axle along y. The middle of its outer face is at the origin, and
/// looks to +y if `side` is 1, to -y if it is -1.
///
/// Its radius, its width and the depth of its dish are metres. The face towards the
/// vehicle is open. Fourteen sides are round to 2.5 % of the radius.
pub fn wheel(b: &mut Builder, [radius_m, width_m, dish_m]: [f64; 3], side: f64) {
    let rim_m = 0.66 * radius_m;
    let profile = Profile::from(0.93 * radius_m, -width_m)
        .line(radius_m, -0.8 * width_m)
        .line(radius_m, -0.2 * width_m)
        .line(0.93 * radius_m, 0.0)
        .line(rim_m, 0.0)
        .line(0.9 * rim_m, -dish_m)
        .line(0.0, -0.5 * dish_m);
    b.place(DAffine3::from_rotation_x(-side * FRAC_PI_2), |b| {
        profile.revolve(b, Section::Polygon(14))
    });
}
