//! The pitch and roll of a moving car's body.

use std::f64::consts::TAU;

use formats::streams::Stream;
use glam::DQuat;

use crate::recipe::Span;

/// The frequencies of the sway, Hz, and the fraction of its variance at each: the rise and fall of
/// the road, and the resonance of the body on its springs at 1 to 2 Hz. The fractions are an
/// assumption: with them, a sway of 0.5 degrees turns the body at 1.5 degrees a second, as
/// gyroscopes of cars in towns measure.
const SPECTRUM: [(f64, f64); 3] = [(0.2, 0.7), (0.6, 0.25), (1.4, 0.05)];

/// The speed below which the sway is proportional to the speed, metres a second.
const FULL_SWAY_M_S: f64 = 5.0;

/// Pitch and roll over time, as sums of sines.
pub(crate) struct Sway {
    /// The standard deviation of each angle, radians.
    sigma_rad: f64,
    /// The phases of pitch and of roll at each frequency, radians.
    phases_rad: [[f64; 3]; 2],
}

impl Sway {
    pub(crate) fn draw(sway_deg: Span, speed_m_s: f64, seed: u64) -> Self {
        let key = Stream::DriveSway {}.key(seed);
        let phase_rad = |axis: u64, i: u64| TAU * key.unit(1 + 3 * axis + i);
        let share = (speed_m_s / FULL_SWAY_M_S).min(1.0);
        Self {
            sigma_rad: sway_deg.at(key.unit(0)).to_radians() * share,
            phases_rad: [0, 1].map(|axis| [0, 1, 2].map(|i| phase_rad(axis, i))),
        }
    }

    /// The rotation of the sensor from its mounted orientation. The road runs along x, so the car
    /// pitches about y and rolls about x.
    pub(crate) fn at(&self, time_s: f64) -> DQuat {
        let [pitch_rad, roll_rad] = self.phases_rad.map(|phases_rad| {
            let waves = SPECTRUM.iter().zip(phases_rad).map(|((hz, share), phase_rad)| {
                // The variance of a sine is half the square of its amplitude.
                (2.0 * share).sqrt() * libm::sin(TAU * hz * time_s + phase_rad)
            });
            self.sigma_rad * waves.sum::<f64>()
        });
        DQuat::from_rotation_y(pitch_rad) * DQuat::from_rotation_x(roll_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over 5 s, in which all waves end, the mean square of an angle is the square of its deviation,
    /// which at half of 5 m/s is half of the recipe's.
    #[test]
    fn pitch_and_roll_sway_as_far_as_the_recipe_says_and_independently() {
        let starts = (0..1000).map(|seed| {
            let sway = Sway::draw([2.0, 2.0].into(), 2.5, seed);
            let angles_deg = |i: u32| {
                let turned = sway.at(0.1 * f64::from(i));
                [turned.y, turned.x].map(|part| 2.0 * libm::atan2(part, turned.w).to_degrees())
            };
            for axis in 0..2 {
                let square = (0..50).map(|i| angles_deg(i)[axis].powi(2)).sum::<f64>() / 50.0;
                assert!((square - 1.0).abs() < 1e-9, "{square}");
            }
            angles_deg(0)
        });
        test_support::assert_uncorrelated("pitch and roll", &starts.collect::<Vec<_>>());
    }
}
