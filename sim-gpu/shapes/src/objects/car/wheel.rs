//! Wheels of cars, lorries and buses.

use std::f64::consts::FRAC_PI_2;

use crate::primitives::{Builder, DAffine3, Profile, Section};

/// A wheel on an axle along y. The middle of its outer face is at the origin and faces +y if `side`
/// is 1, -y if it is -1.
///
/// The measures are the radius, the width and the depth of the dish. The face towards the vehicle
/// is open. The fourteen sides deviate by 2.5 % of the radius from a circle.
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
