//! What an object covers of the ground, so that no two stand in one place.

use glam::DVec2;

/// Space between any two objects, metres.
const CLEARANCE_M: f64 = 0.05;

/// A rectangle on the ground.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    pub(crate) centre: DVec2,
    /// Half of its length along its own x and y axes, metres.
    pub(crate) half: DVec2,
    pub(crate) yaw_rad: f64,
}

impl Footprint {
    /// Whether the two overlap or nearly touch: no line separates them along an
    /// axis of either (the separating axis theorem).
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

    /// How far it reaches from its centre along `axis`.
    pub(crate) fn reach(&self, axis: DVec2) -> f64 {
        let [x, y] = self.axes();
        self.half.x * x.dot(axis).abs() + self.half.y * y.dot(axis).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cars_side_by_side_are_free_and_crossed_ones_are_not() {
        let half = DVec2::new(2.2, 0.9);
        let car = |x, y, yaw_rad| Footprint { centre: DVec2::new(x, y), half, yaw_rad };
        let first = car(0.0, 0.0, 0.0);
        assert!(!first.meets(&car(0.0, 1.9, 0.0)));
        assert!(first.meets(&car(0.0, 1.9, 0.3)));
        assert!(!first.meets(&car(3.2, 0.0, std::f64::consts::FRAC_PI_2)));
        assert!(first.meets(&car(3.0, 0.0, std::f64::consts::FRAC_PI_2)));
        // A corner that points between two others of a turned rectangle: their
        // bounding boxes overlap, they do not.
        assert!(!first.meets(&car(3.6, 1.8, -0.7)));
    }
}
