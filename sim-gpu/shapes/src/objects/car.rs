mod body;
mod cabin;
mod extras;
mod form;
mod interior;
pub(super) mod panel;
pub(super) mod wheel;

use crate::primitives::{Builder, DAffine3, Sampler, dvec3};
use body::Body;
use cabin::Cabin;
use form::Form;

/// Builds a sedan, hatchback, estate, SUV, van, pick-up or coupé.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let form = Form::draw(s);
    let body = Body::draw(s, &form);
    body.build(b);
    Cabin::draw(s, &form, &body).build(b);
    wheels(b, s, &form, &body);
    if s.chance(0.85) {
        interior::build(b, s, &form);
    }
    extras::build(b, s, &form, &body);
}

/// Four wheels. The front wheels are sometimes turned.
fn wheels(b: &mut Builder, s: &mut Sampler, form: &Form, body: &Body) {
    let width_m = s.uniform(0.165, 0.255);
    let steered_rad = if s.chance(0.3) { s.uniform(-25.0, 25.0).to_radians() } else { 0.0 };
    let recess_m = s.uniform(0.01, 0.05);
    let dish_m = s.uniform(0.01, 0.07);
    for (axle, turn_rad) in [(form.axles[0], 0.0), (form.axles[1], steered_rad)] {
        for side in [-1.0, 1.0] {
            let y = side * (body.plan_y(axle) - recess_m);
            b.turned(dvec3(axle, y, form.wheel_m), DAffine3::from_rotation_z(turn_rad), |b| {
                wheel::wheel(b, [form.wheel_m, width_m, dish_m], side)
            });
        }
    }
}
