//! Where a sensor stands on a car, and where each of its lasers points: fitted so
//! that each laser draws a cone around the sensor's axis, and that all turn together.
//!
//! A car moves while a sweep is taken, and the points are moved to where it is at the
//! sweep's reference. So the sensor's origin and axis drift, which is fitted, too.

use super::sweep::Return;
use glam::{DVec3, dvec3};
use nalgebra::{DMatrix, DVector};
use sim_gpu::internals::sensor::Rotating;
use std::f64::consts::TAU;

use super::quantile;

/// The fitted numbers: origin (3), tilt of the axis (2), velocity (3), rate of the
/// tilt (2), deviation of the rate of turning, and the head's uneven turning: sine and
/// cosine of one, two and three times its angle.
const N: usize = 17;
/// The number of values that elevations depend on.
const N_OF_ELEVATION: usize = 10;
/// Steps of Gauss and Newton in each stage; they end at rest well before.
const STEPS: usize = 40;
/// Tukey's biweight leaves out what is this many standard deviations away: it keeps
/// 95 % of the efficiency on Gaussian noise.
const CUT: f64 = 4.685;
/// A numerical derivative's step, in metres, radians and degrees.
const STEP: f64 = 1e-4;
/// From the median distance of Gaussian numbers from their median to their standard deviation.
const MAD_TO_SIGMA: f64 = 1.4826;

/// A sensor's mounting, and its beams as found.
pub struct Mounting {
    /// The fitted numbers, see [`N`].
    values: [f64; N],
    /// 1, or -1 for a sensor that hangs upside down.
    upright: f64,
    /// Row of the profile's table for each laser.
    pub rows: Vec<usize>,
    /// Elevation and azimuth offset less the profile's by row of its table, degrees.
    /// The mean of the latter is 0, since the encoder's zero is unknown.
    pub differences_deg: [Vec<f64>; 2],
    /// Standard deviation of the points around their laser's cone and azimuth, degrees.
    pub scatter_deg: [f64; 2],
}

/// Elevation or azimuth of all points: the mean of each laser, and the weight of each point.
struct Level {
    means: Vec<f64>,
    scatter: f64,
    weights: Vec<f64>,
}

impl Mounting {
    /// Fits the mounting of the sensor of `table` that took `returns`.
    pub fn fit(returns: &[Return], table: &Rotating) -> Self {
        let mut found = Self {
            values: [0.0; N],
            upright: 1.0,
            rows: vec![0; table.beam.len()],
            differences_deg: [Vec::new(), Vec::new()],
            scatter_deg: [0.0; 2],
        };
        // Anywhere above the car converges.
        found.values[2] = 1.5;
        let [elevation, _] = found.converge(returns, table, false);
        found.match_rows(&elevation.means, table);
        let levels = found.converge(returns, table, true);
        let n = found.rows.len();
        found.scatter_deg = [levels[0].scatter, levels[1].scatter];
        let mean_azimuth = levels[1].means.iter().sum::<f64>() / n as f64;
        found.differences_deg = [vec![0.0; n], vec![0.0; n]];
        for (laser, &row) in found.rows.iter().enumerate() {
            found.differences_deg[0][row] =
                found.upright * levels[0].means[laser] - table.beam[row].elevation_deg;
            found.differences_deg[1][row] = found.upright * (levels[1].means[laser] - mean_azimuth);
        }
        found
    }

    pub fn is_upside_down(&self) -> bool {
        self.upright < 0.0
    }

    /// Where the sensor is at the sweep's reference, metres.
    pub fn origin_m(&self) -> DVec3 {
        DVec3::from_slice(&self.values[..3])
    }

    /// How fast the car moves, metres a second.
    pub fn velocity_m_s(&self) -> DVec3 {
        DVec3::from_slice(&self.values[5..8])
    }

    /// How fast the car rolls and pitches, degrees a second.
    pub fn tilting_deg_s(&self) -> f64 {
        self.values[8].hypot(self.values[9]).to_degrees()
    }

    /// How far the head turns from one firing of a laser to its next, degrees.
    pub fn spacing_deg(&self, table: &Rotating) -> f64 {
        (360.0 / table.period_s() + self.values[10]) * table.sequence_us * 1e-6
    }

    /// `point` as the sensor saw it: from its origin at that time, metres.
    pub fn seen_m(&self, point: &Return) -> DVec3 {
        seen_m(&self.values, point)
    }

    /// Gives each laser the row of the same rank by elevation, the right way up.
    fn match_rows(&mut self, elevations_deg: &[f64], table: &Rotating) {
        let ranked = |elevations: &[f64]| {
            let mut order: Vec<usize> = (0..elevations.len()).collect();
            order.sort_by(|&a, &b| elevations[a].total_cmp(&elevations[b]));
            order
        };
        let stated: Vec<f64> = table.beam.iter().map(|beam| beam.elevation_deg).collect();
        let tried = [1.0, -1.0].map(|upright| {
            let elevations: Vec<f64> = elevations_deg.iter().map(|e| upright * e).collect();
            let pairs: Vec<(usize, usize)> =
                ranked(&elevations).into_iter().zip(ranked(&stated)).collect();
            let apart: f64 =
                pairs.iter().map(|&(l, row)| (elevations[l] - stated[row]).abs()).sum();
            (apart, upright, pairs)
        });
        let [up, down] = tried;
        let (_, upright, pairs) = if up.0 <= down.0 { up } else { down };
        self.upright = upright;
        pairs.into_iter().for_each(|(laser, row)| self.rows[laser] = row);
    }

    /// Fits to elevations, `with_azimuths` to azimuths as well.
    fn converge(
        &mut self,
        returns: &[Return],
        table: &Rotating,
        with_azimuths: bool,
    ) -> [Level; 2] {
        let n_lasers = self.rows.len();
        let free = if with_azimuths { N } else { N_OF_ELEVATION };
        let zero = self.encoder_zero(returns, table);
        for _ in 0..STEPS {
            let now = self.angles(&self.values, returns, table, zero);
            let levels = [0, 1].map(|kind| level(&now[kind], returns, n_lasers));
            let slopes: Vec<[Vec<f64>; 2]> = (0..free)
                .map(|i| {
                    let mut values = self.values;
                    values[i] += STEP;
                    let moved = self.angles(&values, returns, table, zero);
                    [0, 1].map(|kind| {
                        let change = moved[kind].iter().zip(&now[kind]);
                        let slope = change.map(|(b, a)| wrapped(b - a) / STEP).collect();
                        less_means(slope, &levels[kind].weights, returns, n_lasers)
                    })
                })
                .collect();
            let mut normal = DMatrix::<f64>::zeros(free, free);
            let mut pull = DVector::<f64>::zeros(free);
            for (kind, level) in levels.iter().enumerate().take(1 + usize::from(with_azimuths)) {
                for (p, point) in returns.iter().enumerate() {
                    let weight = level.weights[p] / level.scatter.powi(2);
                    let residual = now[kind][p] - level.means[point.laser];
                    for i in 0..free {
                        let weighted = weight * slopes[i][kind][p];
                        pull[i] += weighted * residual;
                        (0..free).for_each(|j| normal[(i, j)] += weighted * slopes[j][kind][p]);
                    }
                }
            }
            // A singular matrix, of points that say too little, ends the fit.
            let Some(step) = normal.cholesky().map(|factors| factors.solve(&pull)) else { break };
            step.iter().zip(&mut self.values).for_each(|(step, value)| *value -= step);
            if step.amax() < 1e-6 {
                break;
            }
        }
        let now = self.angles(&self.values, returns, table, zero);
        [0, 1].map(|kind| level(&now[kind], returns, n_lasers))
    }

    /// Elevations in the car's frame, and the lead of azimuths over the encoder, which reads `zero`
    /// in the middle of the sweep; both in degrees.
    fn angles(
        &self,
        values: &[f64; N],
        returns: &[Return],
        table: &Rotating,
        zero: f64,
    ) -> [Vec<f64>; 2] {
        let pairs = returns.iter().map(|point| {
            let seen = seen_m(values, point);
            let since_s = point.time_s - table.period_s() / 2.0;
            let (ax, ay) = (values[3] + values[8] * since_s, values[4] + values[9] * since_s);
            let axis = dvec3(ax, ay, 1.0).normalize();
            let height = seen.dot(axis);
            let level = seen - height * axis;
            let elevation = height.atan2(level.length()).to_degrees();
            let turn = since_s / table.period_s();
            let mut encoder = 360.0 * turn + values[10] * since_s + zero;
            for (k, pair) in (1..).zip(values[11..].chunks_exact(2)) {
                let (sin, cos) = (f64::from(k) * TAU * turn).sin_cos();
                encoder += pair[0] * sin + pair[1] * cos;
            }
            // Argoverse 2's sensors turn clockwise from above, whichever way they hang;
            // the offsets of one that hangs upside down are mirrored.
            let offset = self.upright * table.beam[self.rows[point.laser]].azimuth_offset_deg;
            let azimuth = level.y.atan2(level.x).to_degrees();
            (elevation, wrapped(azimuth + encoder - offset))
        });
        let (elevations, ahead) = pairs.unzip();
        [elevations, ahead]
    }

    /// The encoder's reading in the middle of a sweep, degrees: the mean direction.
    fn encoder_zero(&self, returns: &[Return], table: &Rotating) -> f64 {
        let [_, ahead] = self.angles(&self.values, returns, table, 0.0);
        let sines: f64 = ahead.iter().map(|a| a.to_radians().sin()).sum();
        let cosines: f64 = ahead.iter().map(|a| a.to_radians().cos()).sum();
        -sines.atan2(cosines).to_degrees()
    }
}

/// `point` from the origin that `values` say, metres.
fn seen_m(values: &[f64; N], point: &Return) -> DVec3 {
    let [origin, velocity] = [&values[..3], &values[5..8]].map(DVec3::from_slice);
    point.position_m - origin - velocity * point.time_s
}

/// The robust means of `values` by laser, and how much weight each point has.
fn level(values: &[f64], returns: &[Return], n_lasers: usize) -> Level {
    let mut by_laser = vec![Vec::new(); n_lasers];
    returns.iter().zip(values).for_each(|(r, &value)| by_laser[r.laser].push(value));
    let mut means: Vec<f64> = by_laser.into_iter().map(|values| quantile(values, 0.5)).collect();
    let (mut weights, mut scatter) = (Vec::new(), 0.0);
    for _ in 0..5 {
        let residuals = returns.iter().zip(values).map(|(r, value)| value - means[r.laser]);
        let apart: Vec<f64> = residuals.map(f64::abs).collect();
        // A thousandth of a degree: less is the rounding of the file.
        scatter = (MAD_TO_SIGMA * quantile(apart.clone(), 0.5)).max(1e-3);
        let weight = |apart: &f64| (1.0 - (apart / (CUT * scatter)).powi(2)).max(0.0).powi(2);
        weights = apart.iter().map(weight).collect();
        means = weighted_means(values, &weights, returns, n_lasers);
    }
    Level { means, scatter, weights }
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

/// An angle in degrees within half a turn of 0.
fn wrapped(degrees: f64) -> f64 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}

#[cfg(test)]
mod tests {
    use super::super::sweep;
    use super::*;
    use sim_gpu::internals::sensor::{Layout, SensorProfile};

    #[test]
    fn a_simulated_sweep_gives_the_profile_back() {
        let sensor = SensorProfile::builtin("vlp32c").unwrap();
        let Layout::Rotating(table) = &sensor.layout else { panic!("it rotates") };
        let returns = sweep::simulated(&sensor, table).unwrap();
        let found = Mounting::fit(&returns, table);
        assert!(!found.is_upside_down());
        assert_eq!(found.rows, (0..32).collect::<Vec<_>>());
        // A half float at 12 m is off by up to 4 mm, so one point by 0.02 degrees;
        // each laser has 1,800 points, and four times their mean's error is 0.002.
        for differences in &found.differences_deg {
            assert!(differences.iter().all(|d| d.abs() < 0.002), "{differences:?}");
        }
        assert!((found.origin_m() - dvec3(0.0, 0.0, 1.65)).length() < 0.002);
    }
}
