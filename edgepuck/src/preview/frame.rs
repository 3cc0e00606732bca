//! Which part of space the picture shows, and from where.

use formats::Scan;

/// Room around the points, as a share of the cube they lie in.
const MARGIN: f64 = 1.06;

/// What is farther from the sensor is left out of a sweep's picture.
const FARTHEST_M: f64 = 50.0;

/// What is smaller is an object, seen from three sides.
const LEAST_SWEEP_M: f64 = 8.0;

/// A cube in metres: the same for all panels, so that they share one scale.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    pub centre: [f64; 3],
    pub half: f64,
}

impl Frame {
    /// The frame of the first of these sets of points that has a finite one; a cube of a metre if
    /// none has. Noise far from the object would else shrink it to a dot.
    pub fn around(points: &[&[[f32; 3]]]) -> Self {
        let bounds = points.iter().find_map(|points| bounds(points));
        let (low, high) = bounds.unwrap_or(([0.0; 3], [0.0; 3]));
        let axes = [0, 1, 2];
        let centre = axes.map(|axis| (low[axis] + high[axis]) / 2.0);
        let half = axes.map(|axis| (high[axis] - low[axis]) / 2.0).into_iter().fold(0.0, f64::max);
        Self { centre, half: if half > 0.0 { half * MARGIN } else { 0.5 } }
    }

    /// What is near the sensor of a sweep; the rest would make the picture all road.
    pub fn near_sensor(scan: &Scan) -> Self {
        let sensor_m = scan.sensor_position_m();
        let centre = [0, 1, 2].map(|axis| sensor_m[axis] - scan.origin[axis]);
        let finite = scan.positions.iter().filter(|point| point.iter().all(|x| x.is_finite()));
        let away =
            finite.flat_map(|at| [0, 1].map(|axis| (f64::from(at[axis]) - centre[axis]).abs()));
        let farthest = away.fold(1.0, f64::max);
        Self { centre, half: (farthest * MARGIN).min(FARTHEST_M) }
    }

    /// Whether `scan` is a sweep around its sensor: one picture from above shows it.
    pub fn is_sweep(scan: &Scan) -> bool {
        let Some((low, high)) = bounds(&scan.positions) else { return false };
        let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let across = size[0].max(size[1]);
        let sensor_m = scan.sensor_position_m();
        let is_around = (0..2)
            .all(|axis| (low[axis]..=high[axis]).contains(&(sensor_m[axis] - scan.origin[axis])));
        is_around && across > LEAST_SWEEP_M && across > 3.0 * size[2]
    }

    pub fn extent(&self, axis: usize) -> std::ops::Range<f64> {
        self.centre[axis] - self.half..self.centre[axis] + self.half
    }

    /// Whether the cube holds `point`; it never holds one that is not finite.
    pub fn holds(&self, point: [f32; 3]) -> bool {
        (0..3).all(|axis| self.extent(axis).contains(&f64::from(point[axis])))
    }
}

fn bounds(points: &[[f32; 3]]) -> Option<([f64; 3], [f64; 3])> {
    let finite = points.iter().filter(|point| point.iter().all(|x| x.is_finite()));
    finite.map(|point| point.map(f64::from)).fold(None, |bounds, point| {
        let (mut low, mut high) = bounds.unwrap_or((point, point));
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
        Some((low, high))
    })
}

/// A direction to look in.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub name: &'static str,
    pub right: usize,
    pub up: usize,
    /// The axis along which one looks, and the side one looks from.
    pub depth: (usize, f32),
}

impl View {
    /// The panels from left to right. Each is seen from the side that keeps
    /// the axes right-handed.
    pub const ALL: [Self; 3] = [
        Self { name: "side", right: 0, up: 2, depth: (1, -1.0) },
        Self { name: "top", right: 0, up: 1, depth: (2, 1.0) },
        Self { name: "front", right: 1, up: 2, depth: (0, 1.0) },
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a plate of 20 m, this far from the sensor.
    fn plate(x_m: f32) -> Scan {
        let corners = [[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]];
        let positions = corners.map(|[x, y]| [x + x_m, y, 0.0]).to_vec();
        Scan { positions, ..Scan::default() }
    }

    #[test]
    fn what_is_around_its_sensor_is_a_sweep() {
        assert!(Frame::is_sweep(&plate(0.0)));
        assert!(!Frame::is_sweep(&plate(1e5)));
    }

    #[test]
    fn the_picture_of_a_sweep_holds_its_farthest_points() {
        let scan = plate(3.0);
        let frame = Frame::near_sensor(&scan);
        assert!(scan.positions.iter().all(|point| frame.holds(*point)));
    }
}
