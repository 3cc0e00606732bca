//! A point that moves steadily along one axis, seen with noise.

/// Place and velocity along an axis, and how sure they are: a Kalman filter for
/// constant velocity, disturbed by accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Metres.
    pub place: f64,
    /// Metres a second.
    pub velocity: f64,
    /// Covariance: place, place with velocity, velocity.
    p: [f64; 3],
}

impl Axis {
    /// A thing first seen at `place`, give or take `place_sigma`; it may move at
    /// `velocity_sigma` in either direction.
    pub fn new(place: f64, place_sigma: f64, velocity_sigma: f64) -> Self {
        Self { place, velocity: 0.0, p: [place_sigma.powi(2), 0.0, velocity_sigma.powi(2)] }
    }

    /// Where it will be after `dt` seconds, with accelerations of `acceleration_sigma`
    /// in between that stay the same for that long.
    pub fn after(self, dt: f64, acceleration_sigma: f64) -> Self {
        let [pp, pv, vv] = self.p;
        let q = acceleration_sigma.powi(2);
        Self {
            place: self.place + dt * self.velocity,
            velocity: self.velocity,
            p: [
                pp + 2.0 * dt * pv + dt.powi(2) * vv + q * dt.powi(4) / 4.0,
                pv + dt * vv + q * dt.powi(3) / 2.0,
                vv + q * dt.powi(2),
            ],
        }
    }

    /// The variance of a sighting with noise `sigma`.
    pub fn variance(&self, sigma: f64) -> f64 {
        self.p[0] + sigma.powi(2)
    }

    /// Takes in a sighting at `place` with noise `sigma`.
    pub fn update(&mut self, place: f64, sigma: f64) {
        let innovation = place - self.place;
        let variance = self.variance(sigma);
        let [pp, pv, vv] = self.p;
        let [gain, velocity_gain] = [pp / variance, pv / variance];
        self.place += gain * innovation;
        self.velocity += velocity_gain * innovation;
        self.p = [pp * (1.0 - gain), pv * (1.0 - gain), vv - velocity_gain * pv];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With no accelerations, the filter is the weighted least-squares line through the sightings
    /// and its first guess of the velocity.
    #[test]
    fn without_accelerations_it_is_a_line_of_least_squares() {
        let (sigma, guess) = (0.2, 5.0);
        let seen = [1.0, 1.35, 1.5, 1.95, 2.1];
        let mut axis = Axis::new(seen[0], sigma, guess);
        for place in &seen[1..] {
            axis = axis.after(0.1, 0.0);
            axis.update(*place, sigma);
        }
        // Normal equations of place and velocity at the last sighting; a row per sighting and
        // one for the guess that the velocity is 0.
        let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
        let rows = seen.iter().enumerate().map(|(i, &y)| ([1.0, (i as f64 - 4.0) * 0.1], y, sigma));
        for (row, y, sigma) in rows.chain([([0.0, 1.0], 0.0, guess)]) {
            let weight = 1.0 / f64::powi(sigma, 2);
            for i in 0..2 {
                b[i] += weight * row[i] * y;
                (0..2).for_each(|j| a[i][j] += weight * row[i] * row[j]);
            }
        }
        let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
        let place = (b[0] * a[1][1] - b[1] * a[0][1]) / det;
        let velocity = (a[0][0] * b[1] - a[1][0] * b[0]) / det;
        assert!((axis.place - place).abs() < 1e-9, "{} for {place}", axis.place);
        assert!((axis.velocity - velocity).abs() < 1e-9, "{} for {velocity}", axis.velocity);
        assert!((axis.p[2] - a[0][0] / det).abs() < 1e-9);
    }
}
