//! The box of a whole object, from all of its clusters.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use formats::geometry::OrientedBox;

/// The least weights of the latest box in the mean size and in the mean direction: objects keep
/// their sizes, but they and the sensor turn.
const LEAST_SIZE_WEIGHT: f64 = 0.05;
const LEAST_TURN_WEIGHT: f64 = 0.3;
/// The most weight of a direction after the first: that of a box that takes the width for the length,
/// and is turned by a quarter, then changes nothing.
const MOST_TURN_WEIGHT: f64 = 0.4;
/// The least weight of a longer box: most views show only a part of the length.
const LEAST_LENGTH_WEIGHT: f64 = 0.5;
/// What moves faster than this, metres per second, moves ahead.
const FAST_M_S: f64 = 2.0;
/// How far outside of the box the middle of a piece of the object may be: metres, plus a share of the
/// side. This is the error of the box.
const MARGIN_M: f64 = 0.1;
const MARGIN_SHARE: f64 = 0.1;

/// The box of a whole object: weighted means of the boxes of its clusters.
#[derive(Clone, Copy, Debug, Default)]
pub struct Whole {
    /// The class for which it holds.
    class: usize,
    n_seen: u64,
    /// The box, whose direction is that of the front if the object has moved.
    pub place: OrientedBox,
    /// The mean cosine and sine of twice the direction: boxes do not tell front from rear.
    twice: [f64; 2],
}

impl Whole {
    /// Adds the box of a cluster, which begins at the sensor's side where the points begin. The
    /// `velocity_m_s` tells the front, if it is known in a fixed frame.
    pub fn fuse(
        &mut self,
        class: usize,
        seen: &OrientedBox,
        sensor_m: [f64; 2],
        velocity_m_s: Option<[f64; 3]>,
    ) {
        let n_before = if class == self.class { self.n_seen } else { 0 };
        (self.class, self.n_seen) = (class, n_before + 1);
        let weight = |least: f64| (1.0 / self.n_seen as f64).max(least);
        let [size_weight, turn_weight] = [LEAST_SIZE_WEIGHT, LEAST_TURN_WEIGHT].map(weight);
        let turn_weight = if n_before > 0 { turn_weight.min(MOST_TURN_WEIGHT) } else { 1.0 };
        let (sin, cos) = libm::sincos(2.0 * seen.yaw_rad);
        for (mean, new) in self.twice.iter_mut().zip([cos, sin]) {
            *mean += turn_weight * (new - *mean);
        }
        let axis_rad = 0.5 * libm::atan2(self.twice[1], self.twice[0]);
        let fast = velocity_m_s.filter(|&[x, y, _]| libm::hypot(x, y) > FAST_M_S);
        let OrientedBox { centre_m, size_m: mean_m, yaw_rad } = &mut self.place;
        let ahead_rad = fast.map_or(*yaw_rad, |[x, y, _]| libm::atan2(y, x));
        let is_rear = libm::cos(axis_rad - ahead_rad) < 0.0;
        *yaw_rad = if is_rear { axis_rad - PI.copysign(axis_rad) } else { axis_rad };
        let [length_m, width_m, height_m] = seen.size_m;
        let size_m = match libm::sin(seen.yaw_rad - *yaw_rad).abs() < FRAC_1_SQRT_2 {
            true => [length_m, width_m, height_m],
            false => [width_m, length_m, height_m],
        };
        let least = if size_m[0] > mean_m[0] { LEAST_LENGTH_WEIGHT } else { 0.0 };
        let weights = [size_weight.max(least), size_weight, size_weight];
        for ((mean, new), weight) in mean_m.iter_mut().zip(size_m).zip(weights) {
            *mean += weight * (new - *mean);
        }
        // The near sides stay where they were seen.
        *centre_m = seen.centre_m;
        let (sin, cos) = libm::sincos(*yaw_rad);
        let [dx, dy] = [0, 1].map(|axis| seen.centre_m[axis] - sensor_m[axis]);
        for (side, [x, y]) in [[cos, sin], [-sin, cos]].into_iter().enumerate() {
            let away_m = 0.5 * (mean_m[side] - size_m[side]) * (dx * x + dy * y).signum();
            centre_m[0] += away_m * x;
            centre_m[1] += away_m * y;
        }
    }

    /// Moves the box.
    pub fn advance(&mut self, by_m: [f64; 3]) {
        for (centre, by) in self.place.centre_m.iter_mut().zip(by_m) {
            *centre += by;
        }
    }

    /// Whether a piece of the object of this length may be at `position_m`, after the object has moved
    /// by `by_m`.
    pub fn holds(&self, position_m: [f64; 3], length_m: f64, by_m: [f64; 3]) -> bool {
        let OrientedBox { centre_m, size_m, .. } = self.place;
        let off_m = self.place.along([0, 1, 2].map(|i| position_m[i] - centre_m[i] - by_m[i]));
        let is_near = |(off, size): (f64, f64)| off.abs() <= MARGIN_M + (0.5 + MARGIN_SHARE) * size;
        let fits = length_m <= 2.0 * MARGIN_M + (1.0 + 2.0 * MARGIN_SHARE) * size_m[0];
        self.is_known() && fits && off_m.into_iter().zip(size_m).all(is_near)
    }

    pub fn is_known(&self) -> bool {
        self.n_seen > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(x: f64, [length, width]: [f64; 2], yaw_deg: f64) -> OrientedBox {
        let (centre_m, size_m) = ([x, 0.0, 0.0], [length, width, 1.5]);
        OrientedBox { centre_m, size_m, yaw_rad: yaw_deg.to_radians() }
    }

    fn fused(boxes: &[OrientedBox]) -> OrientedBox {
        let mut whole = Whole::default();
        boxes.iter().for_each(|seen| whole.fuse(1, seen, [0.0; 2], None));
        whole.place
    }

    fn assert_near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
    }

    /// The sides at x = 8 are near. Of lengths, 4.0 and 4.4 count a half each, 3.9 a third, and 4.5 a
    /// half; widths count the same.
    #[test]
    fn the_near_side_stays_and_longer_boxes_count_more() {
        let lengths_m = [4.0, 4.4, 3.9, 4.5];
        let boxes = lengths_m.map(|length| seen(8.0 + length / 2.0, [length, length - 2.4], 0.0));
        let OrientedBox { centre_m, size_m, .. } = fused(&boxes);
        assert_near(size_m[0], 4.3);
        assert_near(size_m[1], 1.8);
        assert_near(centre_m[0], 8.0 + 4.3 / 2.0);
        // Another class begins anew.
        let mut whole = Whole::default();
        whole.fuse(1, &boxes[0], [0.0; 2], None);
        whole.fuse(2, &seen(9.0, [7.0, 2.5], 0.0), [0.0; 2], None);
        assert_eq!(whole.place.size_m, [7.0, 2.5, 1.5]);
    }

    #[test]
    fn directions_are_means_modulo_half_a_turn() {
        let directed = |yaw_deg| seen(8.0, [4.0, 1.6], yaw_deg);
        // Of the doubled angles, 176 and 184 degrees, with the weights 0.6 and 0.4.
        let (cos, sin) = (4.0f64.to_radians().cos(), 0.2 * 4.0f64.to_radians().sin());
        let upright = fused(&[directed(88.0), directed(-88.0)]);
        assert_near(upright.yaw_rad.to_degrees().abs(), 90.0 - 0.5 * sin.atan2(cos).to_degrees());
        assert_near(fused(&[directed(10.0), directed(-80.0)]).yaw_rad.to_degrees(), 10.0);
        let mut boxes = [directed(10.0); 6];
        boxes[5] = OrientedBox { size_m: [1.6, 4.0, 1.5], ..directed(-80.0) };
        let OrientedBox { size_m, yaw_rad, .. } = fused(&boxes);
        assert_near(yaw_rad.to_degrees(), 10.0);
        assert_near(size_m[0], 4.0);
    }

    /// Of many boxes, the latest counts a twentieth of the size and three tenths of the direction.
    #[test]
    fn a_size_is_kept_and_a_direction_follows() {
        let mut boxes = vec![seen(8.0, [4.0, 1.6], 0.0); 200];
        boxes.push(seen(8.0, [4.0, 2.0], 8.0));
        let OrientedBox { size_m, yaw_rad, .. } = fused(&boxes);
        assert_near(size_m[1], 1.6 + 0.05 * 0.4);
        let (sin, cos) = 16f64.to_radians().sin_cos();
        assert_near(yaw_rad.to_degrees(), 0.5 * (0.3 * sin).atan2(0.7 + 0.3 * cos).to_degrees());
    }

    #[test]
    fn a_moved_object_keeps_its_front_when_it_stops() {
        let mut whole = Whole::default();
        for (velocity_m_s, yaw_deg) in
            [(None, 5.0), (Some([-3.0, 0.0, 0.0]), -175.0), (Some([1.0, 0.0, 0.0]), -175.0)]
        {
            whole.fuse(1, &seen(8.0, [4.0, 1.6], 5.0), [0.0; 2], velocity_m_s);
            assert_near(whole.place.yaw_rad.to_degrees(), yaw_deg);
        }
    }

    /// A car of 4 by 1.6 by 1.5 m, which has moved by 1 m along y: 0.1 m and a tenth of a side outside.
    #[test]
    fn pieces_are_within_the_box_and_its_error() {
        let mut whole = Whole::default();
        assert!(!whole.holds([0.0; 3], 0.0, [0.0; 3]));
        whole.fuse(1, &seen(8.0, [4.0, 1.6], 90.0), [0.0; 2], None);
        let holds = |x, y, z| whole.holds([8.0 + x, y, z], 1.0, [0.0, 1.0, 0.0]);
        assert!(holds(1.05, 3.49, 0.99) && holds(-1.05, -1.49, -0.99));
        // Its length, with a tenth of a side and 0.1 m at both ends.
        let at = [8.0, 1.0, 0.0];
        assert!(whole.holds(at, 4.99, [0.0, 1.0, 0.0]) && !whole.holds(at, 5.01, [0.0, 1.0, 0.0]));
        assert!(!holds(1.07, 1.0, 0.0) && !holds(0.0, 3.51, 0.0) && !holds(0.0, 1.0, 1.01));
    }
}
