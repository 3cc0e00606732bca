//! Whether the numbers of a profile are those of a sensor.

use std::f64::consts::{FRAC_PI_2, PI};

use formats::plausible::Warning;

use super::{Layout, SensorProfile};

const TURNS: &str = "revolutions a minute";

impl SensorProfile {
    /// Numbers beyond those of the sensors on the market, which are probably in another unit: 5 to 100
    /// revolutions a second, 3 m of blindness, 2 km of range, 3 cm of noise, 0.5 degrees of divergence, 1.5 cm
    /// of quantum, 300 firings a revolution. The built-in sensors are as they are.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        let sigma_m = self.noise.map_or(0.0, |noise| noise.typical_sigma_m);
        let widest_deg = self.footprint.map_or(0.0, |shape| shape.divergence_deg[0]);
        let mut numbers = vec![
            ("range.min_m", self.range.min_m, 0.0..=30.0, "metres"),
            ("range.max_m", self.range.max_m, 0.1..=2e3, "metres"),
            ("range.quantum_m", self.range.quantum_m.unwrap_or(0.0), 0.0..=0.1, "metres"),
            ("noise.typical_sigma_m", sigma_m, 0.0..=0.5, "metres"),
            ("footprint.divergence_deg", widest_deg, 0.0..=2.0, "degrees"),
        ];
        let (mut azimuths_deg, mut elevations_deg) = (Vec::new(), Vec::new());
        match &self.layout {
            Layout::Rotating(head) => {
                let most_us = 2e6 / head.rpm.clamp(60.0, 6e3);
                numbers.push(("rotating.rpm", head.rpm, 60.0..=6e3, TURNS));
                let (key, found) = ("rotating.sequence_us", head.sequence_us);
                numbers.push((key, found, 0.0..=most_us, "microseconds"));
                elevations_deg.extend(head.beam.iter().map(|beam| beam.elevation_deg));
            }
            Layout::Uniform(grid) => {
                numbers.push(("uniform.rpm", grid.rpm.unwrap_or(600.0), 60.0..=6e3, TURNS));
                azimuths_deg.extend([grid.azimuth_from_deg, grid.azimuth_to_deg]);
                elevations_deg.extend([grid.elevation_from_deg, grid.elevation_to_deg]);
            }
            Layout::Table(table) => {
                (azimuths_deg, elevations_deg) =
                    table.directions_deg.iter().map(|[azimuth, up]| (*azimuth, *up)).unzip();
            }
            Layout::Grid(_) | Layout::Risley(_) => {}
        }
        numbers.retain(|(_, found, usual, _)| !usual.contains(found));
        let numbers = numbers.into_iter().map(|(key, found, _, unit)| (key, found, unit));
        let mut odd: Vec<_> = numbers.map(|it| Warning::NumberOfSensor(it.0, it.1, it.2)).collect();
        // In radians, the last azimuth of a turn is near a half, and elevations are within a quarter.
        for (what, angles, last, most) in [
            ("azimuths", azimuths_deg, 0.95 * PI, PI),
            ("elevations", elevations_deg, -FRAC_PI_2, FRAC_PI_2),
        ] {
            let [low, high] = [f64::min, f64::max].map(|end| angles.iter().copied().reduce(end));
            if let (Some(low), Some(high)) = (low, high)
                && low >= -most
                && low < high
                && (last..=most).contains(&high)
            {
                odd.push(Warning::AnglesOfSensor(what, [low, high]));
            }
        }
        let is_own = |own: Self| own.range == self.range && own.layout == self.layout;
        let is_odd = !odd.is_empty() && !Self::builtin(&self.name).is_some_and(is_own);
        odd.into_iter().filter(|_| is_odd).map(|it| it.of(&self.name)).collect()
    }
}
