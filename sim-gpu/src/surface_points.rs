//! Points distributed uniformly over a surface, as in ModelNet40's clouds, and the visibility of
//! points from a sensor: the clouds that scans are compared with.

use crate::cpu::oracle;
use crate::ray::Ray;
use crate::target::{Surface, Target};
use formats::rng::StreamKey;
use glam::DVec3;

/// A point is visible if nothing lies before this part of its distance. The margin allows for
/// rounding, 1e-16, amplified by grazing triangles.
const HIDDEN_BEFORE: f64 = 1.0 - 1e-7;

/// `n` points on `surface`, in the world, uniform in area; `None` if it has no area. Point k is a
/// function of `key` and k alone. Osada et al. 2002, section 3.3.
#[must_use]
pub fn area_uniform(surface: &Surface, n: usize, key: StreamKey) -> Option<Vec<DVec3>> {
    let mut total = 0.0;
    let areas_up_to: Vec<f64> = surface
        .kept()
        .iter()
        .map(|&triangle| {
            let [a, b, c] = surface.corners(triangle);
            total += 0.5 * (b - a).cross(c - a).length();
            total
        })
        .collect();
    if total.is_nan() || total <= 0.0 {
        return None;
    }
    let point = |k: u64| {
        let [pick, root, share] = [0, 1, 2].map(|i| key.unit(3 * k + i));
        let place = areas_up_to.partition_point(|&area| area <= pick * total);
        let [a, b, c] = surface.corners(surface.kept()[place.min(areas_up_to.len() - 1)]);
        let root = root.sqrt();
        let unit = a * (1.0 - root) + b * (root * (1.0 - share)) + c * (root * share);
        surface.frame.centre + unit * surface.frame.scale
    };
    Some((0..n as u64).map(point).collect())
}

/// Whether each of `points`, on the surface of `target` in the world, is visible from `sensor`.
#[must_use]
pub fn seen_from(target: &Target, sensor: DVec3, points: &[DVec3]) -> Vec<bool> {
    let origin = target.surface.frame.to_unit(sensor);
    let is_seen = |&point: &DVec3| {
        let direction = target.surface.frame.to_unit(point) - origin;
        let nearest = oracle::nearest(target, &Ray { origin, direction });
        // The ray may miss the point's own triangle at an edge; then nothing hides the point.
        nearest.is_none_or(|crossing| crossing.range_m >= HIDDEN_BEFORE)
    };
    points.iter().map(is_seen).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::mesh::TriangleMesh;

    /// A unit square at x = 0, and one of half its side at x = 1, both in y, z.
    fn squares() -> Surface {
        let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let square = |x: f64, s: f64| {
            [corner(x, 0.0, 0.0), corner(x, s, 0.0), corner(x, s, s), corner(x, 0.0, s)]
        };
        let vertices = [square(0.0, 1.0), square(1.0, 0.5)].concat();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        Surface::new(TriangleMesh { vertices, triangles }, vec![0, 1, 2, 3])
    }

    #[test]
    fn points_fall_on_triangles_by_their_area() {
        let key = StreamKey::new(1, "test", 0);
        let points = area_uniform(&squares(), 10_000, key).unwrap();
        let small = points.iter().filter(|p| p.x > 0.5).count();
        // A fifth of the area: 2,000 of 10,000, standard deviation 40; five of them.
        assert!((1800..2200).contains(&small), "{small}");
        let mean = points.iter().filter(|p| p.x < 0.5).map(|p| p.y).sum::<f64>()
            / (points.len() - small) as f64;
        // Uniform in [0, 1]: standard deviation 0.289 / sqrt(8000) = 0.0032; five of them.
        assert!((mean - 0.5).abs() < 0.016, "{mean}");
        // Three products and two sums, of values up to 1, each rounded once.
        let near = |x: f64, plane: f64| (x - plane).abs() <= 5.0 * f64::EPSILON;
        assert!(points.iter().all(|p| near(p.x, 0.0) || near(p.x, 1.0)));
        assert_eq!(points[..10], area_uniform(&squares(), 10, key).unwrap());
    }

    #[test]
    fn what_lies_behind_is_not_seen() {
        let target = Target::new(squares(), Builder::Sah);
        let behind = DVec3::new(0.0, 0.25, 0.25);
        let beside = DVec3::new(0.0, 0.9, 0.9);
        let front = DVec3::new(1.0, 0.25, 0.25);
        let sensor = DVec3::new(5.0, 0.25, 0.25);
        let seen = seen_from(&target, sensor, &[behind, beside, front]);
        assert_eq!(seen, [false, true, true]);
    }

    #[test]
    fn a_surface_without_area_has_no_points() {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        let surface = Surface::new(TriangleMesh { vertices, triangles: vec![[0, 1, 2]] }, vec![0]);
        assert_eq!(area_uniform(&surface, 5, StreamKey::new(0, "test", 0)), None);
        let empty = Surface::new(TriangleMesh::default(), Vec::new());
        assert_eq!(area_uniform(&empty, 5, StreamKey::new(0, "test", 0)), None);
    }
}
