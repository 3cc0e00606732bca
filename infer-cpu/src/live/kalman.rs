/// A Kalman filter for the position and velocity along one axis, with the constant-velocity model
/// and random accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Metres.
    pub place: f64,
    /// Metres per second.
    pub velocity: f64,
    /// The covariance: position, position with velocity, velocity.
    p: [f64; 3],
}

impl Axis {
    /// The state after the first measurement, `place` with standard deviation `place_sigma`. The
    /// velocity is 0 with standard deviation `velocity_sigma`.
    pub fn new(place: f64, place_sigma: f64, velocity_sigma: f64) -> Self {
        Self { place, velocity: 0.0, p: [place_sigma.powi(2), 0.0, velocity_sigma.powi(2)] }
    }

    /// Predicts the state after `dt` seconds. The acceleration in between is constant, with
    /// standard deviation `acceleration_sigma`.
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

    /// The variance of the innovation of a measurement with noise `sigma`.
    pub fn variance(&self, sigma: f64) -> f64 {
        self.p[0] + sigma.powi(2)
    }

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

    /// The covariance becomes F P F' + q G G', with F = [1 t; 0 1] and G = [t^2/2; t].
    #[test]
    fn an_acceleration_of_a_step_widens_the_covariance() {
        let axis = Axis { place: 1.0, velocity: 2.0, p: [0.5, 0.25, 4.0] }.after(2.0, 3.0);
        assert_eq!((axis.place, axis.velocity), (5.0, 2.0));
        assert_eq!(axis.p, [0.5 + 1.0 + 16.0 + 36.0, 0.25 + 8.0 + 36.0, 4.0 + 36.0]);
        assert_eq!(axis.variance(0.5), 53.75);
    }

    /// Without accelerations, the filter is the weighted least-squares line through the
    /// measurements and the initial velocity.
    #[test]
    fn without_accelerations_it_is_a_line_of_least_squares() {
        let (sigma, guess) = (0.2, 5.0);
        let seen = [1.0, 1.35, 1.5, 1.95, 2.1];
        let mut axis = Axis::new(seen[0], sigma, guess);
        for place in &seen[1..] {
            axis = axis.after(0.1, 0.0);
            axis.update(*place, sigma);
        }
        // Normal equations for position and velocity at the last measurement: one row per
        // measurement, and one for the initial velocity of 0.
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
