//! What a sensor reports of each beam, without points: for learning loops, which want ranges.

use super::assemble::{intensity, nearest_per_ray, object, range_m};
use super::measure::{Return, measure};
use super::object_hits::ObjectHits;
use super::receiver::Receiver;
use super::request::ScanRequest;
use crate::config::InvalidValue;
use crate::effects::Effects;
use formats::scan::Attribute;

/// A return of a beam. The fields are those of a [`Scan`](formats::Scan)'s points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeamReturn {
    /// The beam, in firing order.
    pub beam: u32,
    /// The number of the object, or `u32::MAX` for the air.
    pub object: u32,
    /// Metres.
    pub range_m: f32,
    /// Whether it is the second of the two that the return mode asks for.
    pub is_second: bool,
    /// 0 unless the request asks for it.
    pub intensity: f32,
    /// 0 unless the request or an effect asks for it.
    pub power: f32,
}

/// Gives `each` return that `request` asks for from the hits of all `objects`, in firing order; those
/// of one beam follow each other. [`assemble`](super::assemble()) makes points of the same returns.
pub fn each_return(
    request: &ScanRequest,
    cast_effects: &Effects,
    objects: &[ObjectHits],
    mut each: impl FnMut(BeamReturn),
) -> Result<(), InvalidValue> {
    let receiver = Receiver::new(request, cast_effects, objects)?;
    let nearest = nearest_per_ray(objects, request.pattern.len());
    let asks_for_intensity = request.attributes.contains(&Attribute::Intensity);
    measure(&receiver, &nearest, |r: Return| {
        each(BeamReturn {
            beam: request.pattern.beam_of(receiver.ray_of(r.source)),
            object: object(&receiver, &r),
            range_m: range_m(&receiver, &r),
            is_second: r.is_second,
            intensity: if asks_for_intensity { intensity(&receiver, &r) } else { 0.0 },
            power: r.power,
        });
    });
    Ok(())
}
