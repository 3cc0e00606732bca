//! Fog: the return of a pulse from all of it.

use std::f64::consts::PI;

use super::{AirBeam, Medium, Scattered};

const LIGHT_M_S: f64 = 299_792_458.0;

/// Half of the pulse's length: Hahner et al.
const HALF_PULSE_S: f64 = 20e-9;

/// The receiver sees nothing up to here, and all of the beam from there: Hahner et al.
const BLIND_M: f64 = 0.9;
const WHOLE_M: f64 = 1.0;

/// Backscatter per steradian times the visibility: Rasshofer et al. 2011.
const BACKSCATTER: f64 = 0.046;

/// What Hahner et al. hold fog against: 1e-6 / pi.
const HAHNERS_SURFACE: f64 = 1e-6 / PI;

/// The return of fog.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fog {
    /// Where it comes from, metres.
    range_m: f64,
    /// Its power; where it is in proportion to the surface behind it, for one of brightness 1.
    power: f64,
    is_in_proportion: bool,
}

/// The extinction per metre in which one can see so far: ln 20 / V, where a contrast of 5 % is
/// left.
pub(super) fn extinction_of(visibility_m: f64) -> f64 {
    20f64.ln() / visibility_m
}

/// What the fog of this visibility returns to a pulse of its own length, 1 m away.
pub(super) fn of_one_pulse(visibility_m: f64) -> f64 {
    // The integral of sin^2 over the pulse is half of its length.
    PI * LIGHT_M_S / 2.0 * BACKSCATTER / visibility_m * HALF_PULSE_S
}

impl Fog {
    /// Fog of this visibility in air of this extinction, all in all.
    pub fn new(visibility_m: f64, extinction: f64, is_in_proportion: bool) -> Self {
        let (range_m, most) = strongest(extinction);
        let backscatter = BACKSCATTER / visibility_m;
        let power = if is_in_proportion {
            backscatter / HAHNERS_SURFACE * most
        } else {
            PI * LIGHT_M_S / 2.0 * backscatter * most
        };
        Self { range_m, power, is_in_proportion }
    }

    /// What comes back along `beam`.
    pub fn scattered(&self, beam: &AirBeam) -> Option<Scattered> {
        let Self { range_m, .. } = *self;
        if range_m >= beam.end_m {
            return None;
        }
        let (power, brightness) = if self.is_in_proportion {
            let power = self.power * beam.brightness;
            // As that simulation reports it: as if it were as far as the surface.
            (power, (power * beam.end_m.powi(2)).min(1.0))
        } else {
            (self.power, self.power * range_m.powi(2))
        };
        (power > 0.0).then_some(Scattered { range_m, power, brightness, medium: Medium::Fog })
    }
}

/// Where I(R) is largest, metres, and how large it is there, s/m^2.
fn strongest(extinction: f64) -> (f64, f64) {
    let pulse_m = LIGHT_M_S * HALF_PULSE_S;
    // It has one maximum, before the end of the pulse has come through the receiver's blind part.
    let (mut low_m, mut high_m) = (BLIND_M, WHOLE_M + pulse_m);
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let at = |part: f64, low_m: f64, high_m: f64| {
        let range_m = low_m + part * (high_m - low_m);
        (range_m, returned(range_m, extinction))
    };
    let (mut a, mut b) = (at(1.0 - golden, low_m, high_m), at(golden, low_m, high_m));
    // Each step leaves 0.62 of 6 m: 24 of them 0.06 mm.
    for _ in 0..24 {
        if a.1 < b.1 {
            low_m = a.0;
            (a, b) = (b, at(golden, low_m, high_m));
        } else {
            high_m = b.0;
            (a, b) = (at(1.0 - golden, low_m, high_m), a);
        }
    }
    let range_m = 0.5 * (low_m + high_m);
    (range_m, returned(range_m, extinction))
}

/// I(R), s/m^2, by Simpson's rule on each side of where the receiver sees all of the beam.
fn returned(range_m: f64, extinction: f64) -> f64 {
    const STEPS: usize = 16;
    let integrand = |r: f64| {
        let t = 2.0 * (range_m - r) / LIGHT_M_S;
        let seen = ((r - BLIND_M) / (WHOLE_M - BLIND_M)).clamp(0.0, 1.0);
        let pulse = (PI * t / (2.0 * HALF_PULSE_S)).sin().powi(2);
        pulse * (-2.0 * extinction * r).exp() * seen / (r * r)
    };
    let between = |from_m: f64, to_m: f64| {
        let step_m = (to_m - from_m) / STEPS as f64;
        let at = |place: usize| integrand(from_m + place as f64 * step_m / 2.0);
        let thirds = |i: usize| at(2 * i) + 4.0 * at(2 * i + 1) + at(2 * i + 2);
        step_m / 6.0 * (0..STEPS).map(thirds).sum::<f64>()
    };
    let nearest_m = BLIND_M.max(range_m - LIGHT_M_S * HALF_PULSE_S);
    let bend_m = WHOLE_M.clamp(nearest_m, range_m.max(nearest_m));
    // dt is 2/c of dr.
    2.0 / LIGHT_M_S * (between(nearest_m, bend_m) + between(bend_m, range_m.max(bend_m)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_maximum_is_that_of_the_published_tables() {
        // Hahner et al.'s integral tables, by extinction: 1e9 I in s/m^2, and R in steps of 0.1 m.
        for (extinction, most, range_m) in
            [(0.005, 4.568, 4.71), (0.02, 4.347, 4.69), (0.06, 3.817, 4.64), (0.2, 2.476, 4.52)]
        {
            let (found_m, found) = strongest(extinction);
            assert!((found * 1e9 / most - 1.0).abs() < 2e-4, "{extinction}: {found:e}");
            assert!((found_m - range_m).abs() < 0.011, "{extinction}: {found_m} m");
        }
    }

    #[test]
    fn in_proportion_every_beam_beyond_one_range_becomes_fog() {
        // Derived from the same tables: the root of R^2 (beta / beta0) I = exp(-2 a R).
        for (extinction, from_m) in [(0.01, 150.6), (0.06, 35.6), (0.2, 13.6)] {
            let fog = Fog::new(20f64.ln() / extinction, extinction, true);
            let is_fog = |r: f64| fog.power * r * r > (-2.0 * extinction * r).exp();
            assert!(!is_fog(from_m - 0.1) && is_fog(from_m + 0.1), "{extinction}");
        }
    }
}
