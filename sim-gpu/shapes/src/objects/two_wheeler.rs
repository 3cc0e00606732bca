//! Bicycles, motorcycles and scooters, alone or with their riders.

mod bicycle;
mod motorcycle;
mod parts;
mod rider;

use crate::primitives::{Builder, DAffine3, DVec3, Sampler};
use bicycle::Bicycle;
use motorcycle::Motorcycle;

/// The places where a rider touches the vehicle, metres.
pub struct Contacts {
    /// The middle of the saddle's upper side.
    pub saddle: DVec3,
    /// The left grip; the right one is its mirror image.
    pub grip: DVec3,
    /// The soles of the right and the left foot.
    pub soles: [DVec3; 2],
}

/// Builds a bicycle on its wheels, leaning a little to either side, as on its stand.
pub fn bicycle(b: &mut Builder, s: &mut Sampler) {
    let bicycle = Bicycle::draw(s);
    leaning(b, s.uniform(-12.0, 12.0), |b| bicycle.build(b, s));
}

pub fn cyclist(b: &mut Builder, s: &mut Sampler) {
    let bicycle = Bicycle::draw(s);
    leaning(b, s.uniform(-4.0, 4.0), |b| {
        bicycle.build(b, s);
        rider::build(b, s, bicycle.contacts(), false);
    });
}

/// Builds a motorcycle or a scooter on its stand.
pub fn motorcycle(b: &mut Builder, s: &mut Sampler) {
    let motorcycle = Motorcycle::draw(s);
    leaning(b, s.uniform(-12.0, 12.0), |b| motorcycle.build(b, s));
}

pub fn motorcyclist(b: &mut Builder, s: &mut Sampler) {
    let motorcycle = Motorcycle::draw(s);
    leaning(b, s.uniform(-6.0, 6.0), |b| {
        motorcycle.build(b, s);
        rider::build(b, s, motorcycle.contacts(), true);
    });
}

/// Runs `build` in a frame that leans to the right by `lean_deg`.
fn leaning(b: &mut Builder, lean_deg: f64, build: impl FnOnce(&mut Builder)) {
    b.place(DAffine3::from_rotation_x(lean_deg.to_radians()), build);
}
