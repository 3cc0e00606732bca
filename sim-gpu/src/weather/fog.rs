//! The return of a pulse from fog.

use std::f64::consts::PI;

use super::{AirBeam, Medium, Scattered};

const LIGHT_M_S: f64 = 299_792_458.0;

/// Half of the pulse's duration: Hahner et al.
const HALF_PULSE_S: f64 = 20e-9;

/// The length of fog from which light returns at the same time, metres: half of the pulse's length.
const PULSE_M: f64 = LIGHT_M_S * HALF_PULSE_S;

/// The receiver sees nothing up to the first range, and all of the beam from the second: Hahner et
/// al.
const BLIND_M: f64 = 0.9;
const WHOLE_M: f64 = 1.0;

/// Backscatter per steradian times the visibility: Rasshofer et al. 2011.
const BACKSCATTER: f64 = 0.046;

#[derive(Clone, Copy, Debug)]
pub(super) struct Fog {
    /// The range of the maximum of I(R), metres.
    peak_m: f64,
    /// Its power.
    power: f64,
    /// The share of the backscatter from before each border of cells.
    up_to: [f64; CELLS + 1],
}

/// The extinction per metre for this visibility V: ln 20 / V, at which a contrast of 5 % remains.
pub(super) fn extinction_of(visibility_m: f64) -> f64 {
    libm::log(20.0) / visibility_m
}

/// The brightness of this length of fog with this visibility, metres, with clear air before it. At
/// most the length of a pulse counts.
pub(super) fn of_one_pulse(visibility_m: f64, length_m: f64) -> f64 {
    let twice_extinction = 2.0 * extinction_of(visibility_m);
    let length_m = length_m.min(PULSE_M / 2.0);
    -PI * BACKSCATTER / visibility_m * libm::expm1(-twice_extinction * length_m) / twice_extinction
}

impl Fog {
    /// Fog of this visibility, in air of this total extinction.
    pub fn new(visibility_m: f64, extinction: f64) -> Self {
        let (peak_m, most) = strongest(extinction);
        let factor = PI * LIGHT_M_S / 2.0 * (BACKSCATTER / visibility_m);
        Self { peak_m, power: factor * most, up_to: shares(peak_m, extinction) }
    }

    pub fn scattered(&self, beam: &AirBeam) -> Option<Scattered> {
        // The pulse of a surface peaks half of its length after it begins to return, for which
        // sensors correct.
        let range_m = (self.peak_m - PULSE_M / 2.0).max(BLIND_M);
        let power = self.power * self.share_up_to(beam.end_m);
        let brightness = power * range_m.powi(2);
        let is_something = power > 0.0 && range_m < beam.end_m;
        is_something.then_some(Scattered { range_m, power, brightness, medium: Medium::Fog })
    }

    /// The part of the power from the fog before a surface at `end_m`.
    fn share_up_to(&self, end_m: f64) -> f64 {
        let place = (end_m - BLIND_M) / (self.peak_m - BLIND_M) * CELLS as f64;
        if !(0.0..CELLS as f64).contains(&place) {
            return if place < 0.0 { 0.0 } else { 1.0 };
        }
        let cell = place as usize;
        let [a, b] = [self.up_to[cell], self.up_to[cell + 1]];
        a + (b - a) * (place - cell as f64)
    }
}

/// The cells of the table of shares, each about 6 cm wide.
const CELLS: usize = 64;

/// The part of the maximum of I(R) from the fog before each border of cells, between the blind
/// range and the maximum.
fn shares(peak_m: f64, extinction: f64) -> [f64; CELLS + 1] {
    let cell_m = (peak_m - BLIND_M) / CELLS as f64;
    let mut sums = [0.0; CELLS + 1];
    for cell in 0..CELLS {
        let from_m = BLIND_M + cell_m * cell as f64;
        let at = |part: f64| integrand(from_m + part * cell_m, peak_m, extinction);
        // Simpson's rule; the widths cancel.
        sums[cell + 1] = sums[cell] + at(0.0) + 4.0 * at(0.5) + at(1.0);
    }
    let all = sums[CELLS];
    // Fog so thick that nothing returns has no shares.
    sums.map(|sum| if all > 0.0 { sum / all } else { 1.0 })
}

/// The range of the maximum of I(R), metres, and the maximum, s/m^2.
fn strongest(extinction: f64) -> (f64, f64) {
    // It has a single maximum, before the end of the pulse has passed the blind range.
    let (mut low_m, mut high_m) = (BLIND_M, WHOLE_M + PULSE_M);
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let at = |part: f64, low_m: f64, high_m: f64| {
        let range_m = low_m + part * (high_m - low_m);
        (range_m, returned(range_m, extinction))
    };
    let (mut a, mut b) = (at(1.0 - golden, low_m, high_m), at(golden, low_m, high_m));
    // Golden section: each step leaves 0.62 of the interval, 24 steps leave 0.06 mm of 6 m.
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

/// I(R), s/m^2, by Simpson's rule on each side of the range from which the receiver sees all of the
/// beam.
fn returned(range_m: f64, extinction: f64) -> f64 {
    const STEPS: usize = 16;
    let between = |from_m: f64, to_m: f64| {
        let step_m = (to_m - from_m) / STEPS as f64;
        let at =
            |place: usize| integrand(from_m + place as f64 * step_m / 2.0, range_m, extinction);
        let thirds = |i: usize| at(2 * i) + 4.0 * at(2 * i + 1) + at(2 * i + 2);
        step_m / 6.0 * (0..STEPS).map(thirds).sum::<f64>()
    };
    let nearest_m = BLIND_M.max(range_m - PULSE_M);
    let bend_m = WHOLE_M.clamp(nearest_m, range_m.max(nearest_m));
    // dt = 2/c dr.
    2.0 / LIGHT_M_S * (between(nearest_m, bend_m) + between(bend_m, range_m.max(bend_m)))
}

/// The integrand of I(R) for the fog at r.
fn integrand(r: f64, range_m: f64, extinction: f64) -> f64 {
    let t = 2.0 * (range_m - r) / LIGHT_M_S;
    let seen = ((r - BLIND_M) / (WHOLE_M - BLIND_M)).clamp(0.0, 1.0);
    let pulse = libm::sin(PI * t / (2.0 * HALF_PULSE_S)).powi(2);
    pulse * libm::exp(-2.0 * extinction * r) * seen / (r * r)
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
    fn fog_lies_where_a_surface_of_its_light_would_and_is_no_brighter_than_endless_fog() {
        // Single scattering of endless fog: pi beta / (2 a), whatever the visibility.
        let endless = PI * BACKSCATTER / (2.0 * 20f64.ln());
        assert!((endless - 0.0241).abs() < 1e-4);
        for visibility_m in [0.5, 2.0, 10.0, 50.0, 500.0] {
            let fog = Fog::new(visibility_m, extinction_of(visibility_m));
            let along = |end_m| AirBeam {
                origin: glam::DVec3::ZERO,
                direction: glam::DVec3::X,
                end_m,
                stream: formats::rng::StreamKey([1, 2]),
                number: 0,
            };
            let far = fog.scattered(&along(100.0)).unwrap();
            assert!(far.brightness <= endless, "{visibility_m}: {}", far.brightness);
            assert!((BLIND_M..1.8).contains(&far.range_m), "{visibility_m}: {}", far.range_m);
            // A wall takes away the fog behind it, and all of it if it stands before it.
            let near = fog.scattered(&along(2.0)).unwrap();
            assert!(near.power < far.power && near.power > 0.3 * far.power, "{visibility_m}");
            assert!(fog.scattered(&along(0.9)).is_none());
            // By the integral itself, in a hundred thousand steps.
            let extinction = extinction_of(visibility_m);
            let (peak_m, _) = strongest(extinction);
            let up_to = |end_m: f64| {
                let step_m = (end_m - BLIND_M) * 1e-5;
                let at = |i: u32| BLIND_M + (f64::from(i) + 0.5) * step_m;
                (0..100_000).map(|i| integrand(at(i), peak_m, extinction)).sum::<f64>() * step_m
            };
            let (found, expected) = (near.power / far.power, up_to(2.0) / up_to(peak_m));
            assert!((found - expected).abs() < 2e-3, "{visibility_m}: {found} {expected}");
            // So it is of dust, as thick as it may be.
            assert!(of_one_pulse(visibility_m, f64::INFINITY) <= endless);
            let thin = of_one_pulse(visibility_m, 1e-6) / 1e-6;
            assert!((thin / (PI * BACKSCATTER / visibility_m) - 1.0).abs() < 1e-4);
        }
    }
}
