//! The plane of the ground around the sensor.

/// Heights `z = base + x * slope[0] + y * slope[1]`, in metres.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plane {
    base: f32,
    slope: [f32; 2],
}

/// Weights fall with the distance from the plane beyond this: range noise and kerbs.
const NOISE_M: f64 = 0.1;
const ROUNDS: usize = 10;
/// The steepest plane that is accepted, 20 degrees: a steeper one is a wall.
pub const STEEPEST: f32 = 0.364;

impl Plane {
    pub fn level(z_m: f32) -> Self {
        Self { base: z_m, slope: [0.0; 2] }
    }

    /// The plane with the least sum of absolute distances from `points`, found from `level` by
    /// iteratively reweighted least squares. Points that are not ground hardly affect it. Returns
    /// `level` if the points determine no slope.
    pub fn fit<P: Iterator<Item = [f32; 3]>>(level: Self, points: impl Fn() -> P) -> Self {
        let mut plane = [f64::from(level.base), 0.0, 0.0];
        for _ in 0..ROUNDS {
            // Upper triangle of the normal equations, and their right side.
            let (mut a, mut b) = ([[0.0f64; 3]; 3], [0.0f64; 3]);
            for point in points() {
                let [x, y, z] = point.map(f64::from);
                let row = [1.0, x, y];
                let distance = (z - (0..3).map(|i| row[i] * plane[i]).sum::<f64>()).abs();
                let weight = 1.0 / distance.max(NOISE_M);
                for i in 0..3 {
                    b[i] += weight * row[i] * z;
                    (0..3).for_each(|j| a[i][j] += weight * row[i] * row[j]);
                }
            }
            match solve(a, b) {
                Some(solution) => plane = solution,
                None => return level,
            }
        }
        let [base, x, y] = plane;
        if libm::hypot(x, y) > f64::from(STEEPEST) {
            return level;
        }
        Self { base: base as f32, slope: [x as f32, y as f32] }
    }

    pub fn height_m(&self, [x, y, z]: [f32; 3]) -> f32 {
        z - self.z_m(x, y)
    }

    pub fn z_m(&self, x: f32, y: f32) -> f32 {
        self.base + x * self.slope[0] + y * self.slope[1]
    }
}

/// Solves `a x = b` for a positive definite `a` by elimination; `None` if `a` is singular, as for
/// points on one line.
fn solve(mut a: [[f64; 3]; 3], mut b: [f64; 3]) -> Option<[f64; 3]> {
    let scale = a[0][0] + a[1][1] + a[2][2];
    for i in 0..3 {
        if a[i][i] <= 1e-9 * scale {
            return None;
        }
        for row in i + 1..3 {
            let factor = a[row][i] / a[i][i];
            (i..3).for_each(|column| a[row][column] -= factor * a[i][column]);
            b[row] -= factor * b[i];
        }
    }
    let mut x = [0.0; 3];
    for i in (0..3).rev() {
        let known: f64 = (i + 1..3).map(|j| a[i][j] * x[j]).sum();
        x[i] = (b[i] - known) / a[i][i];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of `z = -2 + 0.1 x - 0.05 y`, of which one in three lies higher.
    #[test]
    fn a_plane_is_found_among_points_that_are_not_on_it() {
        let points: Vec<_> = (0..300)
            .map(|i| {
                let (x, y) = (5.0 * (i as f32).cos(), 5.0 * (i as f32).sin());
                let above = if i % 3 == 0 { 0.5 + (i % 7) as f32 / 5.0 } else { 0.0 };
                [x, y, -2.0 + 0.1 * x - 0.05 * y + above]
            })
            .collect();
        let plane = Plane::fit(Plane::level(-1.9), || points.iter().copied());
        assert!((plane.z_m(10.0, 10.0) - -1.5).abs() < 0.1, "{plane:?}");
    }

    #[test]
    fn points_that_tell_no_slope_give_a_level_plane() {
        let line: Vec<_> = (0..100).map(|i| [i as f32, 0.0, i as f32]).collect();
        let wall: Vec<_> = (0..100).map(|i| [5.0, (i % 10) as f32, (i / 10) as f32]).collect();
        let steep: Vec<_> =
            (0..100).map(|i| [(i % 10) as f32, (i / 10) as f32, i as f32]).collect();
        for points in [&line[..], &wall, &steep, &line[..3], &[]] {
            let plane = Plane::fit(Plane::level(-1.0), || points.iter().copied());
            assert_eq!(plane.z_m(7.0, 8.0), -1.0);
        }
    }
}
