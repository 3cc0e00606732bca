//! |cos(incidence)| times reflectivity: BLAINDER's model. Twin of
//! `shaders/effects/intensity.wgsl`.

use crate::cpu::oracle;
use crate::ray::Ray;
use crate::target::Target;

/// The intensity of a return from triangle `index`, 0 to 1.
#[must_use]
pub fn intensity(target: &Target, ray: &Ray, index: u32, reflectivity: f64) -> f64 {
    let cosine = oracle::normal(target, index).dot(ray.direction.normalize()).abs();
    cosine.min(1.0) * reflectivity
}
