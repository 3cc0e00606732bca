//! The box around points.

use std::f32::consts::FRAC_PI_2;

use super::oriented_box::OrientedBox;

/// The direction is searched over a quarter turn in steps of three degrees, and then by single
/// degrees around the best of them.
const COARSE_DEG: i32 = 3;
const QUARTER_DEG: i32 = 90;

/// Points nearer to an edge than this, in metres, count the same: about the range noise of a sensor
/// (the paper's d0).
const NEAR_M: f32 = 0.05;

/// The most points from which the direction is found; of a larger cluster, every second or third.
const MOST_SEARCHED: usize = 300;

impl OrientedBox<f32> {
    /// The box around `points` with the most points near its edges: a sensor sees the near sides of
    /// an object, an L from above (closeness criterion of Zhang, Xu, Dong and Dolan, "Efficient
    /// L-shape fitting for vehicle detection using laser scanners", IV 2017). Points that are not
    /// finite are left out; without finite points, the box has size 0 at the origin. The length is the
    /// longer horizontal side, and its direction is in -pi/2..=pi/2: points alone do not tell front
    /// from rear.
    #[must_use]
    pub fn around(points: &[[f32; 3]]) -> Self {
        let finite = |point: &&[f32; 3]| point.iter().all(|x| x.is_finite());
        let stride = points.len().div_ceil(MOST_SEARCHED).max(1);
        let searched: Vec<_> = points.iter().step_by(stride).filter(finite).collect();
        let points = points.iter().filter(finite);
        let mut along = Vec::with_capacity(searched.len());
        let mut closeness = |degrees: i32| {
            let angle_rad = (degrees as f32).to_radians();
            along.clear();
            along.extend(turned(searched.iter().copied(), angle_rad));
            Rectangle::around(along.iter().copied(), angle_rad).closeness(&along)
        };
        let mut best_of = |directions: &mut dyn Iterator<Item = i32>| {
            let all = directions.map(|degrees| (closeness(degrees), degrees));
            all.reduce(|best, other| if other.0 > best.0 { other } else { best }).map_or(0, |b| b.1)
        };
        let coarse = best_of(&mut (0..QUARTER_DEG).step_by(COARSE_DEG as usize));
        let fine = best_of(&mut (coarse + 1 - COARSE_DEG..coarse + COARSE_DEG));
        let angle_rad = (fine.rem_euclid(QUARTER_DEG) as f32).to_radians();
        let rectangle = Rectangle::around(turned(points.clone(), angle_rad), angle_rad);
        let heights = points.map(|point| point[2]);
        let (low, high) = heights
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
        if low > high {
            return Self::default();
        }
        rectangle.with_heights(low, high)
    }
}

/// Bounds along two axes that are turned by an angle.
#[derive(Clone, Copy)]
struct Rectangle {
    angle_rad: f32,
    low: [f32; 2],
    high: [f32; 2],
}

impl Rectangle {
    /// The bounds of points with these coordinates along the axes.
    fn around(points: impl Iterator<Item = [f32; 2]>, angle_rad: f32) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for along in points {
            for axis in 0..2 {
                low[axis] = low[axis].min(along[axis]);
                high[axis] = high[axis].max(along[axis]);
            }
        }
        Self { angle_rad, low, high }
    }

    /// The sum over points of one over the distance to the nearest edge.
    fn closeness(&self, points: &[[f32; 2]]) -> f32 {
        let to_edge = |along: &[f32; 2]| {
            let distance =
                |axis: usize| (along[axis] - self.low[axis]).min(self.high[axis] - along[axis]);
            distance(0).min(distance(1))
        };
        points.iter().map(|along| to_edge(along).max(NEAR_M).recip()).sum()
    }

    fn with_heights(&self, low_m: f32, high_m: f32) -> OrientedBox<f32> {
        let middle = [0, 1].map(|axis| self.low[axis].midpoint(self.high[axis]));
        let [x, y] = unturned(middle, self.angle_rad);
        let [along, across] = [0, 1].map(|axis| self.high[axis] - self.low[axis]);
        let (length, width, yaw_rad) = match along >= across {
            true => (along, across, self.angle_rad),
            false => (across, along, self.angle_rad - FRAC_PI_2),
        };
        OrientedBox {
            centre_m: [x, y, low_m.midpoint(high_m)],
            size_m: [length, width, high_m - low_m],
            yaw_rad,
        }
    }
}

/// The horizontal coordinates of a point with these along axes turned by `angle_rad`.
fn unturned([along, across]: [f32; 2], angle_rad: f32) -> [f32; 2] {
    let (sin, cos) = libm::sincosf(angle_rad);
    [cos * along - sin * across, sin * along + cos * across]
}

/// The horizontal coordinates of points along axes turned by `angle_rad`.
fn turned<'a>(
    points: impl Iterator<Item = &'a [f32; 3]>,
    angle_rad: f32,
) -> impl Iterator<Item = [f32; 2]> {
    let (sin, cos) = libm::sincosf(angle_rad);
    points.map(move |&[x, y, _]| [cos * x + sin * y, cos * y - sin * x])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sides_of_a_car_give_its_box() {
        for degrees in [-80.0f32, -30.0, 0.0, 17.0, 45.0, 88.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let side = (0..=44).map(|i| [i as f32 * 0.1 - 2.2, -0.9]);
            let rear = (0..=18).map(|i| [-2.2, i as f32 * 0.1 - 0.9]);
            let points: Vec<[f32; 3]> = side
                .chain(rear)
                .flat_map(|[x, y]| {
                    [0.3, 1.5].map(|z| [10.0 + cos * x - sin * y, 3.0 + sin * x + cos * y, z])
                })
                .collect();
            let found = OrientedBox::around(&points);
            // The search goes by degrees.
            assert!((found.yaw_rad.to_degrees() - degrees).abs() < 1.0, "{degrees}: {found:?}");
            let expected = [4.4, 1.8, 1.2];
            for (found, expected) in found.size_m.into_iter().zip(expected) {
                assert!((found - expected).abs() < 0.1, "{degrees}: {found} for {expected}");
            }
            assert!(
                (found.centre_m[0] - 10.0).abs() < 0.1 && (found.centre_m[1] - 3.0).abs() < 0.1
            );
        }
    }

    #[test]
    fn a_box_holds_points_that_are_not_searched() {
        let line: Vec<[f32; 3]> = (0..602).map(|i| [0.01 * i as f32, 0.0, 0.0]).collect();
        assert!((OrientedBox::around(&line).size_m[0] - 6.01).abs() < 1e-4);
    }

    #[test]
    fn nothing_and_single_points_have_boxes() {
        let nothing = OrientedBox::default();
        assert_eq!(OrientedBox::around(&[]), nothing);
        assert_eq!(OrientedBox::around(&[[f32::NAN, 0.0, 1.0]]), nothing);
        let point = OrientedBox::around(&[[1.0, 2.0, 3.0]]);
        assert_eq!(point.size_m, [0.0; 3]);
        assert!((point.centre_m[0] - 1.0).abs() < 1e-6 && point.centre_m[2] == 3.0);
    }

    /// Of 602 points, each third is searched.
    #[test]
    fn a_box_is_as_high_as_points_that_are_not_searched() {
        let mut line: Vec<[f32; 3]> = (0..602).map(|i| [0.01 * i as f32, 0.0, 0.0]).collect();
        (line[301][2], line[302][2]) = (1.5, -0.5);
        assert_eq!(OrientedBox::around(&line).size_m[2], 2.0);
    }
}
