//! Axis-aligned boxes.

use glam::Vec3A;

/// An axis-aligned box in the unit frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The lowest corner.
    pub min: Vec3A,
    /// The highest corner; below `min` for the empty box.
    pub max: Vec3A,
}

impl Bounds {
    /// The empty box, to be grown. A ray test that takes the corners in any order always hits
    /// it: trees hold [`Bounds::NOWHERE`] instead.
    pub const EMPTY: Self = Self { min: Vec3A::splat(f32::MAX), max: Vec3A::splat(f32::MIN) };

    /// A box that no ray hits: a point beyond all distances of casters. It is finite, so that the
    /// arithmetic of rays does not turn it into NaN.
    pub const NOWHERE: Self = Self { min: Vec3A::splat(f32::MAX), max: Vec3A::splat(f32::MAX) };

    /// The bounds of three corners.
    #[must_use]
    pub fn around(corners: &[[f32; 3]; 3]) -> Self {
        let [a, b, c] = corners.map(Vec3A::from_array);
        Self { min: a.min(b).min(c), max: a.max(b).max(c) }
    }

    /// The bounds of both boxes.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The box grown to hold `point`.
    #[must_use]
    pub fn with(self, point: Vec3A) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Half the surface area; 0 for the empty box.
    #[must_use]
    pub fn half_area(self) -> f32 {
        // Negative for the empty box.
        let size = (self.max - self.min).max(Vec3A::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Twice the centre.
    #[must_use]
    pub fn doubled_centre(self) -> Vec3A {
        self.min + self.max
    }

    /// The box grown by `margin` on all sides; the empty box stays empty.
    #[must_use]
    pub fn padded(self, margin: f32) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Whether `other` lies inside.
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.min.cmple(other.min).all() && self.max.cmpge(other.max).all()
    }
}
