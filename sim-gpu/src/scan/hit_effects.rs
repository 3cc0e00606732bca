//! The outputs of the effects for one hit.

use super::object_hits::{HitId, ObjectHits};
use crate::cpu::effects::{dropout, intensity, noise_range, noise_xyz};
use crate::effects::{Effects, NoiseModel, RayEffect};
use crate::resolve::{Hit, Hits};
use crate::sensor::BeamPattern;
use formats::rng::StreamKey;
use glam::DVec3;

#[derive(Default)]
pub(super) struct HitEffects {
    /// Metres, in world axes; range noise is in x alone.
    pub noise: DVec3,
    pub dropped: bool,
    pub intensity: f32,
}

impl HitEffects {
    /// The outputs for a hit of `object`: as its caster computed them, or else computed here.
    #[inline]
    pub fn of_hit(
        cast_effects: &Effects,
        pattern: &BeamPattern,
        object: &ObjectHits,
        id: HitId,
    ) -> Self {
        let Hits { hits, effect_outputs, .. } = object.hits;
        let hit = id.hit as usize;
        let per_hit = cast_effects.outputs_per_ray();
        if let Some(outputs) = effect_outputs.get(hit * per_hit..(hit + 1) * per_hit) {
            return Self::read(cast_effects, outputs);
        }
        let (job, Hit { beam, triangle, .. }) = (object.job, &hits[hit]);
        let mut own = Self::of_ray(cast_effects, job.stream, *beam);
        if cast_effects.intensity.is_some() {
            let ray = job.beam(pattern, *beam);
            own.intensity = intensity(&job.target, &ray, *triangle, job.reflectivity.into()) as f32;
        }
        own
    }

    /// The outputs that do not depend on the surface, for a ray.
    #[inline]
    pub fn of_ray(cast_effects: &Effects, stream: StreamKey, ray: u32) -> Self {
        let noise = cast_effects.noise.map(|noise| match noise.model {
            NoiseModel::Range => DVec3::X * noise_range(&noise, stream, ray),
            NoiseModel::Xyz => noise_xyz(&noise, stream, ray),
        });
        let dropped = cast_effects.dropout.is_some_and(|model| dropout(&model, stream, ray));
        // Casters answer in f32.
        let noise = noise.unwrap_or_default().as_vec3().as_dvec3();
        Self { noise, dropped, intensity: 0.0 }
    }

    fn read(cast_effects: &Effects, mut outputs: &[f32]) -> Self {
        let mut found = Self::default();
        for effect in cast_effects.per_ray() {
            let (own, others) = outputs.split_at(effect.width());
            outputs = others;
            match effect {
                RayEffect::NoiseRange(_) => found.noise.x = own[0].into(),
                RayEffect::NoiseXyz(_) => {
                    found.noise = DVec3::new(own[0].into(), own[1].into(), own[2].into());
                }
                RayEffect::Dropout(_) => found.dropped = own[0] != 0.0,
                RayEffect::Intensity => found.intensity = own[0],
            }
        }
        found
    }
}
