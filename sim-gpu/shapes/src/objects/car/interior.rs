//! The interior of a car, which beams reach through the panes.

use super::form::{Form, Style};
use crate::primitives::*;

/// Builds the dashboard, seats with head rests, sometimes a driver, and the bulkhead of a van.
pub fn build(b: &mut Builder, s: &mut Sampler, form: &Form) {
    let inner_y = 0.8 * form.half.y;
    let foot = form.screen[0];
    let belt_m = form.top_m(foot);
    // The floor of a cabin is about 0.3 m above the road in cars and 0.6 m in vans.
    let floor_m = if form.style.is_boxy() { 0.55 } else { form.sill_m + 0.14 };
    let dash = [foot - s.uniform(0.4, 0.6), foot - 0.15];
    let low = dvec3(dash[0], -inner_y, floor_m + 0.25);
    block_between(b, low, dvec3(dash[1], inner_y, belt_m - 0.03));
    let front_x = form.middle_pillar_x() + s.uniform(-0.05, 0.15);
    let seat = Seat { y: 0.45 * form.half.y, width_m: 0.5, floor_m, belt_m };
    b.mirrored_y(|b| seat.build(b, front_x));
    if s.chance(0.35) {
        let y = s.pick(&[-1.0, 1.0]) * seat.y;
        driver(b, dvec3(front_x + 0.18, y, floor_m + 0.25));
    }
    match form.style {
        Style::Van => {
            let low = dvec3(front_x - 0.3, -inner_y, floor_m);
            block_between(b, low, dvec3(front_x - 0.27, inner_y, form.height_m - 0.15));
        }
        Style::PickUp | Style::Coupe => {}
        _ => {
            let bench_x = (front_x - s.uniform(0.8, 0.95)).max(form.rear[0] + 0.35);
            b.mirrored_y(|b| seat.build(b, bench_x));
        }
    }
}

struct Seat {
    y: f64,
    width_m: f64,
    floor_m: f64,
    belt_m: f64,
}

impl Seat {
    /// Adds the seat, with the foot of its back at `x`.
    fn build(&self, b: &mut Builder, x: f64) {
        let cushion_m = self.floor_m + 0.28;
        let back_m = (self.belt_m + 0.12 - cushion_m).max(0.5);
        block(b, dvec3(x + 0.25, self.y, cushion_m - 0.1), dvec3(0.5, self.width_m, 0.2));
        // Backs are reclined by about 20 degrees.
        let reclined = DAffine3::from_rotation_y(-20f64.to_radians());
        b.turned(dvec3(x, self.y, cushion_m), reclined, |b| {
            block(b, 0.5 * back_m * DVec3::Z, dvec3(0.13, self.width_m, back_m));
            block(b, (back_m + 0.13) * DVec3::Z, dvec3(0.09, 0.26, 0.17));
        });
    }
}

/// The upper body and the head of a person who sits at `at`.
fn driver(b: &mut Builder, at: DVec3) {
    ellipsoid(b, at + dvec3(-0.05, 0.0, 0.28), dvec3(0.13, 0.2, 0.32));
    ellipsoid(b, at + dvec3(-0.1, 0.0, 0.7), dvec3(0.1, 0.08, 0.12));
}
