//! Footprints of objects on the ground, which must not overlap.

use glam::DVec2;

/// The least space between two objects, metres.
const CLEARANCE_M: f64 = 0.05;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    pub(crate) centre: DVec2,
    /// Half its size along its own x and y axes, metres.
    pub(crate) half: DVec2,
    pub(crate) yaw_rad: f64,
}

impl Footprint {
    pub(crate) fn level(centre: DVec2, half: DVec2) -> Self {
        Self { centre, half, yaw_rad: 0.0 }
    }

    /// Whether the two rectangles overlap or nearly touch, by the separating axis theorem.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        let between = other.centre - self.centre;
        let axes = self.axes().into_iter().chain(other.axes());
        axes.into_iter().all(|axis| {
            let reach = self.reach(axis) + other.reach(axis) + CLEARANCE_M;
            between.dot(axis).abs() < reach
        })
    }

    fn axes(&self) -> [DVec2; 2] {
        let x = DVec2::from_angle(self.yaw_rad);
        [x, x.perp()]
    }

    /// The extent from the centre along `axis`, metres.
    pub(crate) fn reach(&self, axis: DVec2) -> f64 {
        let [x, y] = self.axes();
        self.half.x * x.dot(axis).abs() + self.half.y * y.dot(axis).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parallel_rectangles_may_touch_and_crossing_ones_meet() {
        let half = DVec2::new(2.2, 0.9);
        let car = |x, y, yaw_rad| Footprint { centre: DVec2::new(x, y), half, yaw_rad };
        let first = car(0.0, 0.0, 0.0);
        assert!(!first.meets(&car(0.0, 1.9, 0.0)));
        assert!(first.meets(&car(0.0, 1.9, 0.3)));
        assert!(!first.meets(&car(3.2, 0.0, std::f64::consts::FRAC_PI_2)));
        assert!(first.meets(&car(3.0, 0.0, std::f64::consts::FRAC_PI_2)));
        // The bounding boxes of these two overlap, but the rectangles do not.
        assert!(!first.meets(&car(3.6, 1.8, -0.7)));
    }
}
