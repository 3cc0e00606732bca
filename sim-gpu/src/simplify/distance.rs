//! The distance from a point to a surface, in f64.

use glam::DVec3;
use std::array;

use crate::bvh::{
    Bounds, Entered, Leaf4, Search, Stack, WideChild, WideNode, boxes_that, traverse,
};
use crate::target::{Surface, Target};

/// The distance from `point` to the triangle of these corners, which may be
/// degenerate. Ericson, "Real-Time Collision Detection", 2005, section 5.1.5.
#[must_use]
pub fn distance_to_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let normal = ab.cross(ac);
    let squared = normal.length_squared();
    if squared > 0.0 {
        // Barycentric coordinates of the foot of the perpendicular.
        let v = ap.cross(ac).dot(normal) / squared;
        let w = ab.cross(ap).dot(normal) / squared;
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return ap.dot(normal).abs() / squared.sqrt();
        }
    }
    [(a, b), (b, c), (c, a)]
        .into_iter()
        .map(|(p, q)| to_segment(point, p, q))
        .fold(f64::INFINITY, f64::min)
}

fn to_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let along = to - from;
    let squared = along.length_squared();
    let t = if squared > 0.0 { ((point - from).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (point - (from + along * t)).length()
}

/// The distance from `point` to the surface of `target`, both in its unit frame; infinite for an
/// empty surface.
#[must_use]
pub fn distance_to_surface(target: &Target, point: DVec3) -> f64 {
    let mut search = NearestTo { point, surface: &target.surface, nearest: f64::INFINITY };
    if !target.surface.is_empty() {
        traverse(&target.bvh.wide, WideChild::ROOT, &mut Stack::default(), &mut search);
    }
    search.nearest
}

struct NearestTo<'a> {
    point: DVec3,
    surface: &'a Surface,
    nearest: f64,
}

impl Search for NearestTo<'_> {
    type Distance = f64;

    fn enter(&self, node: &WideNode) -> Entered<f64> {
        let distances = array::from_fn(|i| to_box(self.point, node.bounds(i)));
        (boxes_that(|i| self.matters(distances[i])), distances)
    }

    fn matters(&self, distance: f64) -> bool {
        distance < self.nearest
    }

    fn visit(&mut self, leaf: &Leaf4) {
        for &index in leaf.indices() {
            let distance = distance_to_triangle(self.point, self.surface.corners(index));
            self.nearest = self.nearest.min(distance);
        }
    }
}

/// Boxes are padded by more than their rounding to f32.
fn to_box(point: DVec3, bounds: Bounds) -> f64 {
    (point.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()) - point).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::mesh::TriangleMesh;

    const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    #[test]
    fn each_region_of_a_triangle_has_its_distance() {
        for (point, distance) in [
            (DVec3::new(0.25, 0.25, -2.0), 2.0),
            (DVec3::new(0.5, -3.0, 4.0), 5.0),
            (DVec3::new(4.0, 0.0, 4.0), 5.0),
            (DVec3::new(1.0, 1.0, 0.0), 0.5f64.sqrt()),
            (DVec3::new(0.0, 0.5, 0.0), 0.0),
        ] {
            assert!((distance_to_triangle(point, CORNERS) - distance).abs() < 1e-15, "{point}");
        }
        let [a, b, _] = CORNERS;
        assert_eq!(distance_to_triangle(DVec3::Y, [a, a, a]), 1.0);
        assert_eq!(distance_to_triangle(DVec3::new(0.5, 0.0, 2.0), [a, b, a]), 2.0);
    }

    #[test]
    fn the_tree_finds_what_a_search_of_all_triangles_finds() {
        let key = formats::rng::StreamKey::new(1, "points", 0);
        // Small triangles all over a cube.
        let vertex = |i: u64| {
            let around = |n| DVec3::from_array([0, 1, 2].map(|axis| key.unit(3 * n + axis)));
            around(1_000 + i / 3) + 0.1 * around(10_000 + i)
        };
        let n_triangles = 500;
        let vertices = (0..3 * n_triangles).map(vertex).collect();
        let triangles = (0..n_triangles as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let kept = (0..n_triangles as u32).collect();
        let surface = Surface::new(TriangleMesh { vertices, triangles }, kept);
        let target = Target::new(surface, Builder::Morton);
        for i in 0..200 {
            let point =
                DVec3::new(key.unit(3 * i), key.unit(3 * i + 1), key.unit(3 * i + 2)) * 4.0 - 2.0;
            let all = target.surface.kept().iter();
            let expected = all
                .map(|&t| distance_to_triangle(point, target.surface.corners(t)))
                .fold(f64::INFINITY, f64::min);
            assert_eq!(distance_to_surface(&target, point), expected);
        }
    }
}
