use glam::DVec3;

use super::Builder;

/// Points along the Catmull-Rom spline through `points` (two or more), with at least `least`
/// segments between neighbours.
pub fn smooth(b: &Builder, points: &[DVec3], least: usize) -> Vec<DVec3> {
    let last = points.len() - 1;
    let mut path = vec![points[0]];
    for i in 0..last {
        let [p1, p2] = [points[i], points[i + 1]];
        // The curve's ends continue as the mirror image of their first span.
        let p0 = if i == 0 { 2.0 * p1 - p2 } else { points[i - 1] };
        let p3 = if i + 1 == last { 2.0 * p2 - p1 } else { points[i + 2] };
        let n = b.curved(p1.distance(p2), least);
        path.extend((1..=n).map(|k| catmull_rom([p0, p1, p2, p3], k as f64 / n as f64)));
    }
    path
}

/// The uniform Catmull-Rom curve from the second point (t = 0) to the third (t = 1).
fn catmull_rom([p0, p1, p2, p3]: [DVec3; 4], t: f64) -> DVec3 {
    let linear = p2 - p0;
    let square = 2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3;
    let cube = 3.0 * (p1 - p2) + p3 - p0;
    p1 + 0.5 * t * (linear + t * (square + t * cube))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spline_passes_through_its_points_and_keeps_a_line_straight() {
        let b = Builder::new(0.1, 1.0);
        let points = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        let path = smooth(&b, &points, 1);
        assert_eq!(path.len(), 21);
        assert!(path.iter().all(|p| p.y == 0.0 && p.z == 0.0));
        // One rounding of each of the few sums above, at a magnitude of 2.
        assert!(path[10].distance(DVec3::X) < 1e-15 && path[20].distance(points[2]) < 1e-15);
    }
}
