//! Surfaces swept along a path: rods, handles, rails, cords.

use glam::{DVec2, DVec3, dvec2};

use super::{Builder, loft, outline, smooth};

/// A round tube of `radius_m` along `path`, with closed ends.
pub fn tube(b: &mut Builder, path: &[DVec3], radius_m: f64) {
    let section = outline::ellipse(DVec2::splat(radius_m), b.around(radius_m, 6));
    sweep(b, path, &section);
}

/// Like [`tube`], along the smooth curve through `points`, with at least `least` segments between
/// neighbours.
pub fn smooth_tube(b: &mut Builder, points: &[DVec3], least: usize, radius_m: f64) {
    let path = smooth(b, points, least);
    tube(b, &path, radius_m);
}

/// A round rod with these radii at its two ends.
pub fn rod(b: &mut Builder, from: DVec3, to: DVec3, radii_m: [f64; 2]) {
    let widest_m = radii_m[0].max(radii_m[1]);
    let unit = outline::ellipse(DVec2::ONE, b.around(widest_m, 6));
    let frame = Frame::towards(to - from);
    let ends = [(from, radii_m[0]), (to, radii_m[1])];
    let sections = ends.map(|(at, radius)| frame.place(&unit, at, radius));
    loft(b, &sections);
}

/// A bar of rectangular section. `width_m` is its level side where the direction allows it,
/// `height_m` the other one.
pub fn bar(b: &mut Builder, from: DVec3, to: DVec3, width_m: f64, height_m: f64) {
    sweep(b, &[from, to], &outline::rectangle(dvec2(width_m, height_m) / 2.0));
}

/// Sweeps `section` (x level, y up where the path allows it) along `path` without twisting it, and
/// closes the ends.
pub fn sweep(b: &mut Builder, path: &[DVec3], section: &[DVec2]) {
    let last = path.len() - 1;
    let mut frame = Frame::towards(path[1] - path[0]);
    let sections: Vec<_> = (0..=last)
        .map(|i| {
            frame = frame.turned(path[(i + 1).min(last)] - path[i.saturating_sub(1)]);
            frame.place(section, path[i], 1.0)
        })
        .collect();
    loft(b, &sections);
}

/// The plane across a path, with the axes of the section.
#[derive(Clone, Copy)]
struct Frame {
    x: DVec3,
    y: DVec3,
}

impl Frame {
    fn towards(direction: DVec3) -> Self {
        let along = direction.normalize_or(DVec3::Z);
        let up = if along.z.abs() < 0.99 { DVec3::Z } else { DVec3::Y };
        let x = along.cross(up).normalize_or(DVec3::X);
        // x, y, along must be right-handed for faces to look outwards.
        Self { x, y: along.cross(x) }
    }

    /// The frame rotated by the smallest angle to a new direction.
    fn turned(self, direction: DVec3) -> Self {
        let along = direction.normalize_or(self.x.cross(self.y));
        let x = (self.x - self.x.dot(along) * along).normalize_or(Self::towards(along).x);
        Self { x, y: along.cross(x) }
    }

    fn place(self, section: &[DVec2], at: DVec3, scale: f64) -> Vec<DVec3> {
        section.iter().map(|p| at + scale * (p.x * self.x + p.y * self.y)).collect()
    }
}
