//! From hits to the returns that a sensor reports: the echoes of each beam are merged where the
//! receiver cannot resolve them, detected, selected by the return mode, and measured.

use super::echo::{Echo, Source, merge, select_returns};
use super::hit_effects::HitEffects;
use super::normals::Normals;
use super::object_hits::{HitId, Tally};
use super::power;
use super::receiver::{NoEcho, Receiver};
use crate::effects::NoiseModel;
use glam::DVec3;

/// What a sensor reports of an echo.
#[derive(Clone, Copy)]
pub(super) struct Return {
    pub source: Source,
    /// The measured distance from the start of the beam, metres.
    pub range_m: f64,
    /// How far noise moves the point from there, metres, in world axes; 0 unless it moves points
    /// sideways.
    pub aside_m: DVec3,
    /// As [`Signal::brightness`](super::echo::Signal::brightness); 0 unless something needs it.
    pub brightness: f32,
    /// As [`Scan::power`](formats::Scan::power), likewise.
    pub power: f32,
    /// As [`Scan::reflectivity`](formats::Scan::reflectivity), likewise.
    pub reflectivity: u8,
    /// As [`Scan::return_number`](formats::Scan::return_number).
    pub number: u8,
    /// Whether it is the second of the two that the return mode asks for.
    pub is_second: bool,
}

/// Measures the returns of a scan from `nearest`, the nearest hit of each ray that hit anything,
/// by ray: gives `each` of them, and counts those that are lost.
pub(super) fn measure(receiver: &Receiver, nearest: &[HitId], each: impl FnMut(Return)) -> Tally {
    let mut measurer = Measurer {
        receiver,
        each,
        tally: Tally::default(),
        echoes: Vec::new(),
        normals: Normals::new(receiver.objects),
    };
    if receiver.has_one_echo_per_beam() {
        nearest.iter().for_each(|&id| measurer.measure_hit(id));
    } else {
        measurer.measure_beams(nearest);
    }
    measurer.tally
}

struct Measurer<'a, Each> {
    receiver: &'a Receiver<'a>,
    each: Each,
    tally: Tally,
    echoes: Vec<Echo>,
    normals: Normals,
}

impl<Each: FnMut(Return)> Measurer<'_, Each> {
    /// Measures a hit that is the only echo of its beam.
    #[inline]
    fn measure_hit(&mut self, id: HitId) {
        match self.receiver.echo_of_hit(id, &mut self.normals) {
            Ok(echo) => self.measure_echo(&echo, 0, false),
            Err(NoEcho::NotLit) => {}
            Err(NoEcho::OutOfRange) => self.tally.out_of_range += 1,
            Err(NoEcho::Glass) => self.tally.dropped += 1,
        }
    }

    fn measure_beams(&mut self, nearest: &[HitId]) {
        let (receiver, pattern) = (self.receiver, self.receiver.pattern());
        let ray_of = |id: &HitId| receiver.hit(*id).beam;
        let beam_of = |id: &HitId| pattern.beam_of(ray_of(id));
        let air_returns_alone = receiver.air.as_ref().is_some_and(|air| air.empty_beams);
        let mut next = 0;
        for hits in nearest.chunk_by(|a, b| beam_of(a) == beam_of(b)) {
            let beam = beam_of(&hits[0]);
            if air_returns_alone {
                (next..beam).for_each(|empty| self.measure_beam(empty, &[]));
                next = beam + 1;
            } else if !hits.iter().any(|id| receiver.is_lit(ray_of(id))) {
                continue;
            }
            self.measure_beam(beam, hits);
        }
        if air_returns_alone {
            let n_beams = pattern.beam_of(pattern.len() as u32);
            (next..n_beams).for_each(|empty| self.measure_beam(empty, &[]));
        }
    }

    fn measure_beam(&mut self, beam: u32, hits: &[HitId]) {
        let receiver = self.receiver;
        self.collect_surface_echoes(hits);
        if let Some(air) = &receiver.air {
            receiver.add_air_echoes(air, beam, hits, &mut self.echoes);
        }
        if self.echoes.len() > 1 {
            merge(&mut self.echoes, receiver.separation_m());
        }
        if let Some((detection, limit)) = receiver.effects.detection.zip(receiver.limit) {
            let before = self.echoes.len();
            self.echoes.retain(|echo| {
                let (stream, ray) = receiver.random_key(echo.source);
                power::is_detected(&detection, &limit, echo.signal.power, stream, ray)
            });
            self.tally.undetected += (before - self.echoes.len()) as u64;
        }
        if self.echoes.is_empty() {
            return;
        }
        let mode = receiver.effects.returns.unwrap_or_default();
        let (first, second) = select_returns(&self.echoes, mode);
        let echo = self.echoes[first];
        self.measure_echo(&echo, first, false);
        if let Some(second) = second {
            let echo = self.echoes[second];
            self.measure_echo(&echo, second, true);
        }
    }

    fn collect_surface_echoes(&mut self, hits: &[HitId]) {
        self.echoes.clear();
        let (mut is_out_of_range, mut is_lost) = (false, false);
        for &id in hits {
            match self.receiver.echo_of_hit(id, &mut self.normals) {
                Ok(echo) => self.echoes.push(echo),
                Err(NoEcho::OutOfRange) => is_out_of_range = true,
                Err(NoEcho::Glass) => is_lost = true,
                Err(NoEcho::NotLit) => {}
            }
        }
        if self.echoes.is_empty() {
            self.tally.dropped += u64::from(is_lost);
            self.tally.out_of_range += u64::from(is_out_of_range && !is_lost);
        }
    }

    /// Measures a detected echo, number `place` of its beam, with the errors of the sensor.
    #[inline]
    fn measure_echo(&mut self, echo: &Echo, place: usize, is_second: bool) {
        let Echo { signal, source, .. } = *echo;
        let receiver = self.receiver;
        let effects = &receiver.effects;
        let (stream, ray) = receiver.random_key(source);
        let outputs = match source {
            Source::Surface(id) => {
                let (cast, pattern) = (receiver.cast_effects, receiver.pattern());
                HitEffects::of_hit(cast, pattern, receiver.object(id), id)
            }
            Source::Air { .. } => HitEffects::of_ray(receiver.cast_effects, stream, ray),
        };
        if effects.dropout.is_some() && outputs.dropped {
            self.tally.dropped += 1;
            return;
        }
        let (along_m, aside_m) = match effects.noise.map(|noise| noise.model) {
            Some(NoiseModel::Range) => (outputs.noise.x, DVec3::ZERO),
            Some(NoiseModel::Xyz) => (0.0, outputs.noise),
            None => (0.0, DVec3::ZERO),
        };
        let sigma_m = effects.detection.and_then(|detection| detection.range_sigma_m);
        let timing_m = sigma_m.zip(receiver.limit).map_or(0.0, |(sigma_m, limit)| {
            power::range_error(sigma_m, &limit, signal.power, stream, ray)
        });
        let mut range_m = echo.range_m + along_m + timing_m;
        if let Some(step_m) = effects.quantum.and_then(|quantum| quantum.step_m) {
            range_m = (range_m / step_m).round() * step_m;
        }
        if range_m <= 0.0 {
            self.tally.negative += 1;
            return;
        }
        (self.each)(Return {
            source,
            range_m,
            aside_m,
            brightness: signal.brightness as f32,
            power: signal.power.min(f64::from(f32::MAX)) as f32,
            reflectivity: power::calibrated(signal.brightness, signal.retroreflection),
            // At most 37: one for each ray of the widest beam.
            number: place as u8 + 1,
            is_second,
        });
    }
}
