//! The width of a beam, and the rays that sample it.

use std::f64::consts::TAU;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, within};

/// The width of a sensor's beams, and its range resolution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeamShape {
    /// Full angles of divergence, horizontal and vertical, degrees: where the power density of a
    /// Gaussian beam is 1/e^2 of that on its axis.
    pub divergence_deg: [f64; 2],
    /// Surfaces whose ranges differ by less than this give one return, metres.
    pub separation_m: f64,
}

/// The widest beam: the tangent of half of it must exist.
const WIDEST_DEG: f64 = 90.0;

impl BeamShape {
    pub(crate) fn validate(&self, key: &str) -> Result<(), InvalidValue> {
        Self::check_divergence(key, self.divergence_deg)?;
        within(&format!("{key}.separation_m"), self.separation_m, 0.0..=f64::MAX)
    }

    pub(crate) fn check_divergence(
        key: &str,
        divergence_deg: [f64; 2],
    ) -> Result<(), InvalidValue> {
        for (i, angle_deg) in divergence_deg.into_iter().enumerate() {
            within(&format!("{key}.divergence_deg[{i}]"), angle_deg, 0.0..=WIDEST_DEG)?;
        }
        Ok(())
    }
}

/// Unit vectors of the rays that sample a beam along `direction`, its axis first.
pub(super) fn rays_of(
    direction: DVec3,
    disc: &[[f64; 2]],
    divergence_deg: [f64; 2],
) -> impl Iterator<Item = DVec3> {
    let across = DVec3::Z.cross(direction).try_normalize().unwrap_or(DVec3::Y);
    let up = direction.cross(across);
    let [wide, high] = divergence_deg.map(|full_deg| libm::tan(full_deg.to_radians() / 2.0));
    disc.iter().map(move |&[x, y]| match [x, y] {
        // Not normalized again, so that the axis equals the beam of a sensor without width.
        [0.0, 0.0] => direction,
        _ => (direction + across * (x * wide) + up * (y * high)).normalize(),
    })
}

/// Points of equal power in a Gaussian beam, in units of the radius at which its power density is
/// 1/e^2 of that on the axis: a centre, and `6 i` points on ring i around it.
///
/// Each ring samples an annulus that holds its share of the power. With `t = 2 r^2 / w^2` the power
/// within r is `1 - exp(-t)`. A ring's `r^2` is the mean over its annulus, and all radii are
/// stretched by one factor to account for the disc that the centre samples. The mean of `r^2` over
/// all points is thus the beam's, `w^2 / 2`, and the mean range of a plane is correct to the second
/// order of its tilt.
pub(super) fn disc(samples: u32) -> Vec<[f64; 2]> {
    let share = f64::from(samples).recip();
    let mut points = vec![[0.0, 0.0]];
    let (mut ring, mut sum) = (0, 0.0);
    let mut inner = share;
    while (points.len() as u32) < samples {
        ring += 1;
        let count = 6 * ring;
        let outer = (inner + f64::from(count) * share).min(1.0);
        let mean_t = (moment(inner) - moment(outer)) / (outer - inner);
        sum += f64::from(count) * mean_t;
        let radius = (mean_t / 2.0).sqrt();
        // Every second ring is turned by a quarter of a step, so that a straight edge meets few
        // points at once.
        let turn = f64::from(ring % 2) / 4.0;
        points.extend((0..count).map(|i| {
            let angle_rad = TAU * (f64::from(i) + turn) / f64::from(count);
            [radius * libm::cos(angle_rad), radius * libm::sin(angle_rad)]
        }));
        inner = outer;
    }
    let stretch = if sum > 0.0 { (share * sum).recip().sqrt() } else { 1.0 };
    points.iter().map(|point| point.map(|x| x * stretch)).collect()
}

/// The integral of `t exp(-t)` to infinity from the radius that encloses `power`.
fn moment(power: f64) -> f64 {
    let rest = 1.0 - power;
    if rest <= f64::EPSILON { 0.0 } else { rest * (1.0 - libm::log(rest)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLES: [u32; 4] = [1, 7, 19, 37];

    #[test]
    fn a_beam_has_its_second_moments_whatever_its_samples() {
        for samples in SAMPLES {
            let points = disc(samples);
            assert_eq!(points.len(), samples as usize);
            let mean =
                |of: fn(&[f64; 2]) -> f64| points.iter().map(of).sum::<f64>() / f64::from(samples);
            assert!(mean(|p| p[0]).abs() < 1e-15 && mean(|p| p[1]).abs() < 1e-15);
            let of_gaussian = if samples == 1 { 0.0 } else { 0.25 };
            assert!((mean(|p| p[0] * p[0]) - of_gaussian).abs() < 1e-15, "{samples}");
            assert!((mean(|p| p[1] * p[1]) - of_gaussian).abs() < 1e-15, "{samples}");
            assert!(mean(|p| p[0] * p[1]).abs() < 1e-15, "{samples}");
        }
    }

    /// The error function: Abramowitz and Stegun 7.1.26, within 1.5e-7.
    fn erf(x: f64) -> f64 {
        let t = (1.0 + 0.327_591_1 * x.abs()).recip();
        let coefficients =
            [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
        let sum = coefficients.into_iter().fold(0.0, |sum, c| (sum + c) * t);
        x.signum() * (1.0 - sum * (-x * x).exp())
    }

    #[test]
    fn a_straight_edge_cuts_off_what_it_cuts_off_a_gaussian_beam() {
        // The beam's power on one side of an edge at u radii is (1 + erf(sqrt(2) u)) / 2.
        // An edge meets the points on a line parallel to it at once: the error is at least half
        // of their number. These are the measured maxima over all edges.
        for (samples, worst) in [(1, 0.5), (7, 0.215), (19, 0.107), (37, 0.06)] {
            let points = disc(samples);
            let mut largest: f64 = 0.0;
            for direction in 0..90 {
                let (sine, cosine) = (TAU * f64::from(direction) / 360.0).sin_cos();
                for step in -200..=200 {
                    let u = f64::from(step) / 100.0 + 1e-9;
                    let within = points.iter().filter(|p| p[0] * cosine + p[1] * sine < u).count();
                    let exact = 0.5 * (1.0 + erf(2f64.sqrt() * u));
                    largest = largest.max((within as f64 / f64::from(samples) - exact).abs());
                }
            }
            assert!(largest <= worst, "{samples} samples: {largest}");
            assert!(largest > 0.9 * worst, "{samples} samples: only {largest}; state it");
        }
    }

    #[test]
    fn rays_have_unit_length_and_the_beam_in_their_middle_even_straight_up() {
        for direction in [DVec3::X, DVec3::Z, -DVec3::Z, DVec3::new(0.6, 0.0, 0.8)] {
            let rays: Vec<DVec3> = rays_of(direction, &disc(19), [0.2, 0.1]).collect();
            assert_eq!(rays[0], direction);
            assert!(rays.iter().all(|ray| (ray.length() - 1.0).abs() < 1e-15));
            let middle = rays.iter().sum::<DVec3>() / 19.0;
            assert!((middle - direction).length() < 2e-6, "{direction}");
        }
    }
}
