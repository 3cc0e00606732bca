//! The frame of casting and of the validation of meshes.

use glam::DVec3;

/// Maps an object to its unit frame: the centre of its bounding box to 0, and half of its longest
/// side to (0.5, 1]. The scale is a power of two, so that scaling does not round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitFrame {
    /// The centre of the bounding box, in the object's units.
    pub centre: DVec3,
    /// The unit length in the object's units; a power of two.
    pub scale: f64,
}

impl UnitFrame {
    /// The frame of these vertices; the identity if there are none.
    #[must_use]
    pub fn around(vertices: impl Iterator<Item = DVec3>) -> Self {
        let (low, high) = bounding_box(vertices);
        if low.x > high.x {
            return Self { centre: DVec3::ZERO, scale: 1.0 };
        }
        // Halved before they are added: the sum of two huge values overflows.
        let half_size = high * 0.5 - low * 0.5;
        Self { centre: low + half_size, scale: power_of_two_above(half_size.max_element()) }
    }

    /// Maps from the object's frame to the unit frame.
    #[must_use]
    pub fn to_unit(&self, point: DVec3) -> DVec3 {
        (point - self.centre) / self.scale
    }

    /// Maps from the unit frame to the object's frame.
    #[must_use]
    pub fn to_object(&self, point: DVec3) -> DVec3 {
        point * self.scale + self.centre
    }
}

/// The lowest and the highest coordinates of `points`; of none, infinity and minus infinity.
#[must_use]
pub fn bounding_box(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| {
        (low.min(point), high.max(point))
    })
}

/// The least normal power of two that is at least `x`, or the largest of f64; 1 for 0.
fn power_of_two_above(x: f64) -> f64 {
    const LARGEST: f64 = f64::from_bits(0x7FE << 52);
    if x.is_nan() || x <= 0.0 {
        return 1.0;
    }
    let x = x.max(f64::MIN_POSITIVE);
    let floor = f64::from_bits(x.to_bits() & (0x7FF << 52));
    if floor == x { floor } else { (floor * 2.0).min(LARGEST) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_frame_scales_by_powers_of_two_only() {
        let known = [(0.5, 0.5), (0.50001, 1.0), (0.75, 1.0), (1.0, 1.0), (1.01, 2.0), (2.0, 2.0)];
        let others = [1e-300, 0.4, 1.5, 3e7, 1.7e12, 1e300].map(|half| (half, 0.0));
        for (half, scale) in known.into_iter().chain(others) {
            let frame = UnitFrame::around([DVec3::splat(-half), DVec3::splat(half)].into_iter());
            let unit = frame.to_unit(DVec3::splat(half)).x;
            assert!(unit > 0.5 && unit <= 1.0, "{half} maps to {unit}");
            assert_eq!(frame.scale.to_bits() << 12, 0, "{} is a power of two", frame.scale);
            assert!(scale == 0.0 || frame.scale == scale);
        }
    }

    #[test]
    fn a_point_keeps_its_scale() {
        assert_eq!(UnitFrame::around([DVec3::ONE].into_iter()).scale, 1.0);
    }

    #[test]
    fn a_huge_box_does_not_overflow() {
        let frame = UnitFrame::around([DVec3::splat(-1e308), DVec3::splat(1e308)].into_iter());
        assert!(frame.centre.is_finite() && frame.scale.is_finite());
    }
}
