//! How fast a head turns, and how evenly.

use super::estimate::Estimate;
use super::firings::{Firing, Recording};

/// The unit of azimuths in packets, turns: no rate of one turn is finer.
const UNIT: f64 = 0.01 / 360.0;

pub struct Turning {
    /// Turns a minute.
    pub rpm: Estimate,
    /// Standard deviation of the rate from turn to turn, turns a minute.
    pub between_rpm: Estimate,
    /// Deviation of the angle from an even turning within a turn, root of the mean square, degrees.
    pub within_deg: Estimate,
    pub is_clockwise: bool,
}

/// The rate by a line of angle over time through each turn, with one offset for each laser; `None`
/// without times.
pub fn turning(recording: &Recording) -> Option<Turning> {
    let (mut rates, mut deviations) = (Vec::new(), Vec::new());
    for turn in 0..recording.n_turns {
        let first = recording.start + turn as f64;
        let mut sums = [0.0; 3];
        let mut n = 0;
        for ring in &recording.rings {
            let from = ring.firings.partition_point(|firing| firing.turns < first);
            let to = ring.firings.partition_point(|firing| firing.turns < first + 1.0);
            let mut fired: Vec<&Firing> =
                ring.firings[from..to].iter().filter(|firing| firing.time_s.is_finite()).collect();
            // Gaps of half a turn leave open which way the head turned.
            if (fired.len() as f64) * ring.step < 0.6 {
                continue;
            }
            fired.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
            let [mut angle, mut before] = [fired[0].turns; 2];
            let line = fired.iter().map(|firing| {
                let step = firing.turns - before;
                (angle, before) = (angle + step - step.round(), firing.turns);
                [firing.time_s, angle]
            });
            let line: Vec<[f64; 2]> = line.collect();
            let mean = [0, 1]
                .map(|of| line.iter().map(|point| point[of]).sum::<f64>() / line.len() as f64);
            for [time, angle] in line {
                let [x, y] = [time - mean[0], angle - mean[1]];
                sums = [sums[0] + x * x, sums[1] + x * y, sums[2] + y * y];
                n += 1;
            }
        }
        let [xx, xy, yy] = sums;
        if n > 0 && xx > 0.0 {
            rates.push(60.0 * xy / xx);
            deviations.push(360.0 * ((yy - xy * xy / xx).max(0.0) / f64::from(n)).sqrt());
        }
    }
    let is_clockwise = rates.iter().sum::<f64>() >= 0.0;
    rates.iter_mut().for_each(|rate| *rate = rate.abs());
    let n = rates.len() as f64;
    let rpm = Estimate::mean(&rates, rates.iter().sum::<f64>() / n * UNIT / n.sqrt())?;
    let sigma =
        (rates.iter().map(|rate| (rate - rpm.value).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let between_rpm = Estimate::normal(sigma, sigma / (2.0 * (n - 1.0)).sqrt(), rates.len());
    let mut within_deg = Estimate::mean(&deviations, 0.0)?;
    within_deg.low = within_deg.low.max(0.0);
    Some(Turning { rpm, between_rpm, within_deg, is_clockwise })
}
