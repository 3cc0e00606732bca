//! Where a sensor stands on a car: fitted so that each of its lasers draws a cone around the sensor's
//! axis, at any elevation.
//!
//! A car moves while a sweep is taken, and the points are moved to where it is at the
//! sweep's reference. So the sensor's origin and axis drift, which is fitted, too.

use anyhow::{Context, Result, bail};
use formats::labelled_sweep::LabelledSweep;
use glam::{DVec3, dvec3};
use nalgebra::{DMatrix, DVector};

/// The fitted numbers: origin (3), tilt of the axis (2), velocity (3), rate of the tilt (2).
const N: usize = 10;
/// Steps of Gauss and Newton; they end at rest well before.
const STEPS: usize = 40;
/// Tukey's biweight leaves out what is this many standard deviations away: it keeps
/// 95 % of the efficiency on Gaussian noise.
const CUT: f64 = 4.685;
/// A numerical derivative's step, in metres, radians and degrees.
const STEP: f64 = 1e-4;
/// From the median distance of Gaussian numbers from their median to their standard deviation.
const MAD_TO_SIGMA: f64 = 1.4826;

#[derive(Clone, Copy)]
pub struct Return {
    /// Where, in the car's frame, metres.
    position_m: DVec3,
    /// Number of its laser, from 0 for each sensor. The order is unknown.
    laser: usize,
    /// Since the sweep's reference, seconds.
    time_s: f64,
}

/// The returns of `sweep` by sensor, each of which has `n_lasers`.
pub fn by_sensor(sweep: &LabelledSweep, n_lasers: usize) -> Result<Vec<Vec<Return>>> {
    let lasers = sweep.lasers.as_ref().context("expected `laser`, found none")?;
    let times = sweep.times_s.as_ref().context("expected `offset_ns`, found none")?;
    let n_sensors = lasers.iter().max().map_or(0, |&most| usize::from(most) / n_lasers + 1);
    let mut sensors = vec![Vec::new(); n_sensors];
    for ((&point, &laser), &time_s) in sweep.points.iter().zip(lasers).zip(times) {
        let position_m = DVec3::from_array(point);
        let (sensor, laser) = (usize::from(laser) / n_lasers, usize::from(laser) % n_lasers);
        sensors[sensor].push(Return { position_m, laser, time_s });
    }
    for (i, returns) in sensors.iter().enumerate() {
        let mut counts = vec![0; n_lasers];
        returns.iter().for_each(|r| counts[r.laser] += 1);
        if let Some(few) = counts.iter().position(|&n| n < 100) {
            let laser = i * n_lasers + few;
            bail!("laser {laser}: expected 100 returns, found {}", counts[few]);
        }
    }
    Ok(sensors)
}

/// Where the sensor that took `returns` is at the sweep's reference, metres; a sweep takes
/// `period_s`.
pub fn origin_m(returns: &[Return], n_lasers: usize, period_s: f64) -> DVec3 {
    let mut values = [0.0; N];
    // Anywhere above the car converges.
    values[2] = 1.5;
    for _ in 0..STEPS {
        let now = elevations_deg(&values, returns, period_s);
        let (means, weights) = level(&now, returns, n_lasers);
        let slopes: Vec<Vec<f64>> = (0..N)
            .map(|i| {
                let mut moved = values;
                moved[i] += STEP;
                let moved = elevations_deg(&moved, returns, period_s);
                let slope = moved.iter().zip(&now).map(|(b, a)| (b - a) / STEP).collect();
                less_means(slope, &weights, returns, n_lasers)
            })
            .collect();
        let residuals: Vec<f64> =
            returns.iter().zip(&now).map(|(r, e)| e - means[r.laser]).collect();
        let product = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).zip(&weights).map(|((a, b), weight)| weight * a * b).sum::<f64>()
        };
        let normal = DMatrix::from_fn(N, N, |i, j| product(&slopes[i], &slopes[j]));
        let pull = DVector::from_fn(N, |i, _| product(&slopes[i], &residuals));
        // A singular matrix, of points that say too little, ends the fit.
        let Some(step) = normal.cholesky().map(|factors| factors.solve(&pull)) else { break };
        step.iter().zip(&mut values).for_each(|(step, value)| *value -= step);
        if step.amax() < 1e-6 {
            break;
        }
    }
    DVec3::from_slice(&values[..3])
}

/// Elevations above the plane across the sensor's axis, degrees.
fn elevations_deg(values: &[f64; N], returns: &[Return], period_s: f64) -> Vec<f64> {
    let [origin, velocity] = [&values[..3], &values[5..8]].map(DVec3::from_slice);
    let elevation = |point: &Return| {
        let seen = point.position_m - origin - velocity * point.time_s;
        let since_s = point.time_s - period_s / 2.0;
        let (ax, ay) = (values[3] + values[8] * since_s, values[4] + values[9] * since_s);
        let axis = dvec3(ax, ay, 1.0).normalize();
        let height = seen.dot(axis);
        height.atan2((seen - height * axis).length()).to_degrees()
    };
    returns.iter().map(elevation).collect()
}

/// The robust means of `values` by laser, and how much weight each point has.
fn level(values: &[f64], returns: &[Return], n_lasers: usize) -> (Vec<f64>, Vec<f64>) {
    let mut by_laser = vec![Vec::new(); n_lasers];
    returns.iter().zip(values).for_each(|(r, &value)| by_laser[r.laser].push(value));
    let mut means: Vec<f64> = by_laser.into_iter().map(median).collect();
    let mut weights = Vec::new();
    for _ in 0..5 {
        let residuals = returns.iter().zip(values).map(|(r, value)| value - means[r.laser]);
        let apart: Vec<f64> = residuals.map(f64::abs).collect();
        // A thousandth of a degree: less is the rounding of the file.
        let scatter = (MAD_TO_SIGMA * median(apart.clone())).max(1e-3);
        let weight = |apart: &f64| (1.0 - (apart / (CUT * scatter)).powi(2)).max(0.0).powi(2);
        weights = apart.iter().map(weight).collect();
        means = weighted_means(values, &weights, returns, n_lasers);
    }
    (means, weights)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

fn weighted_means(
    values: &[f64],
    weights: &[f64],
    returns: &[Return],
    n_lasers: usize,
) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); n_lasers];
    for ((point, value), weight) in returns.iter().zip(values).zip(weights) {
        let (sum, total) = &mut sums[point.laser];
        *sum += weight * value;
        *total += weight;
    }
    sums.into_iter().map(|(sum, total)| if total > 0.0 { sum / total } else { 0.0 }).collect()
}

/// `values` less the mean of their laser: the slope when each laser's own angle is a free
/// parameter.
fn less_means(
    mut values: Vec<f64>,
    weights: &[f64],
    returns: &[Return],
    n_lasers: usize,
) -> Vec<f64> {
    let means = weighted_means(&values, weights, returns, n_lasers);
    values.iter_mut().zip(returns).for_each(|(value, r)| *value -= means[r.laser]);
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cones around a tilted axis that meet the walls of a street, seen from a car at 10 m/s.
    #[test]
    fn the_origin_is_found_from_cones_alone() {
        let (origin, velocity) = (dvec3(1.35, -0.2, 1.64), dvec3(10.0, 0.1, 0.0));
        let axis = dvec3(0.01, -0.02, 1.0).normalize();
        let (east, period_s) = (axis.any_orthonormal_vector(), 0.1);
        let north = axis.cross(east);
        let firing = |i: usize| {
            let (laser, turn) = (i % 16, (i / 16) as f64 / 360.0);
            let time_s = period_s * turn;
            let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
            let (up, level) = (2.0 * laser as f64 - 15.0).to_radians().sin_cos();
            let ray = level * (cos * east + sin * north) + up * axis;
            let range_m = (12.0 / ray.y.abs()).min(60.0 / ray.x.abs());
            Return { position_m: origin + velocity * time_s + range_m * ray, laser, time_s }
        };
        let returns: Vec<Return> = (0..16 * 360).map(firing).collect();
        let found = origin_m(&returns, 16, period_s);
        // Without noise what is left is a numerical derivative's error, 1e-4 of a step.
        assert!((found - origin).length() < 1e-4, "{found}");
    }
}
