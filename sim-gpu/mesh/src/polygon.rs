//! Cuts polygons into triangles.

use earcut::Earcut;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// A polygon is flat if its extent across its plane is at most this part of its size.
const FLATNESS: f64 = 0.01;

/// The part of a polygon's size or area that is attributed to the rounding of its corners.
const ROUNDING: f64 = 1e-6;

/// How a polygon is to be cut, and what is wrong with it.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Cut {
    /// Triangles as numbers of corners, turned as the polygon is. They replace the fan around
    /// corner 0 unless that covers the polygon.
    pub triangles: Option<Vec<[usize; 3]>>,
    /// Whether sides cross each other, so that the surface is a guess.
    pub crosses_itself: bool,
    pub is_uneven: bool,
}

/// The triangles of the fan around the first of these corners.
pub(super) fn fan<T: Copy>(corners: &[T]) -> impl Iterator<Item = [T; 3]> {
    corners.windows(2).skip(1).map(|side| [corners[0], side[0], side[1]])
}

/// The reverse of [`fan`].
pub(super) fn corners<T: Copy>(fan: &[[T; 3]]) -> Vec<T> {
    fan[0].into_iter().chain(fan[1..].iter().map(|triangle| triangle[2])).collect()
}

/// Cuts a polygon, which may be far from the origin and of any size.
pub(super) fn cut(mut corners: Vec<DVec3>) -> Cut {
    let largest = |corners: &[DVec3]| {
        corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max)
    };
    // Products of coordinates must neither overflow nor vanish.
    let scale = largest(&corners).max(f64::MIN_POSITIVE);
    let origin = corners[0] / scale;
    corners.iter_mut().for_each(|corner| *corner = *corner / scale - origin);
    let scale = largest(&corners).max(f64::MIN_POSITIVE);
    corners.iter_mut().for_each(|corner| *corner /= scale);

    let areas: Vec<DVec3> = fan(&corners).map(|[_, a, b]| a.cross(b)).collect();
    let area: DVec3 = areas.iter().sum();
    let Some(normal) = area.try_normalize().filter(|_| area.length() > ROUNDING * ROUNDING) else {
        // Either all corners are in line, or the parts of the surface cancel each other.
        let crosses_itself = areas.iter().any(|area| area.length() > ROUNDING);
        return Cut { crosses_itself, ..Cut::default() };
    };
    let heights = || corners.iter().map(|corner| corner.dot(normal));
    let thickness = heights().fold(f64::MIN, f64::max) - heights().fold(f64::MAX, f64::min);
    let size = corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
    let is_uneven = thickness > FLATNESS * size;

    let is_turned_right = |part: &DVec3| part.dot(normal) >= -ROUNDING * area.length();
    let angles =
        fan(&corners).zip(&areas).map(|([_, a, b], area)| libm::atan2(area.length(), a.dot(b)));
    if areas.iter().all(is_turned_right) && angles.sum::<f64>() < TAU + ROUNDING {
        return Cut { is_uneven, ..Cut::default() };
    }
    let points = projected(&corners, normal);
    let mut numbers = Vec::new();
    Earcut::new().earcut(points.iter().map(|point| point.to_array()), &[], &mut numbers);
    let mut triangles: Vec<[usize; 3]> = numbers.as_chunks().0.to_vec();
    let mut covered = 0.0;
    for triangle in &mut triangles {
        let [a, b, c] = triangle.map(|corner| points[corner]);
        let twice_area = (b - a).perp_dot(c - a);
        covered += twice_area.abs();
        if twice_area < 0.0 {
            triangle.swap(1, 2);
        }
    }
    let expected = normal.abs().max_element() * area.length();
    let crosses_itself = (covered - expected).abs() > ROUNDING * expected || crosses(&points);
    // As many as the fan has: those without area stand for corners on straight sides.
    triangles.resize(corners.len() - 2, [0; 3]);
    Cut { triangles: Some(triangles).filter(|_| covered > 0.0), crosses_itself, is_uneven }
}

/// The polygon seen along the axis that is nearest to its normal, from where it turns to the left.
fn projected(corners: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    let axis = normal.abs().max_position();
    let (mut x, mut y) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        (x, y) = (y, x);
    }
    corners.iter().map(|corner| DVec2::new(corner[x], corner[y])).collect()
}

/// Whether two sides of a polygon of size 1 cross; to touch is not to cross.
fn crosses(points: &[DVec2]) -> bool {
    let ends = points.iter().skip(1).chain(points.first());
    let mut sides: Vec<[DVec2; 2]> = points.iter().zip(ends).map(|(a, b)| [*a, *b]).collect();
    let left = |side: &[DVec2; 2]| side[0].x.min(side[1].x);
    sides.sort_by(|a, b| left(a).total_cmp(&left(b)));
    sides.iter().enumerate().any(|(number, side)| {
        let right = side[0].x.max(side[1].x);
        let near = sides[number + 1..].iter().take_while(|other| left(other) <= right);
        near.into_iter().any(|other| parts(side, other) && parts(other, side))
    })
}

/// Whether the ends of `other` are on different sides of the line through `line`.
fn parts(line: &[DVec2; 2], other: &[DVec2; 2]) -> bool {
    let along = line[1] - line[0];
    let [a, b] = other.map(|end| along.perp_dot(end - line[0]) / along.length());
    a.min(b) < -ROUNDING && a.max(b) > ROUNDING
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The area of the triangles into which a polygon of the plane z = 0 is cut, all of which turn
    /// to the left as it does, and whether its sides cross.
    fn area(corners: &[[f64; 2]]) -> (f64, bool) {
        let points: Vec<DVec2> = corners.iter().copied().map(DVec2::from_array).collect();
        let cut = cut(points.iter().map(|point| point.extend(0.0)).collect());
        assert!(!cut.is_uneven);
        let numbers: Vec<usize> = (0..points.len()).collect();
        let triangles = cut.triangles.unwrap_or_else(|| fan(&numbers).collect());
        assert_eq!(triangles.len(), points.len() - 2);
        let twice_area = |triangle: &[usize; 3]| {
            let [a, b, c] = triangle.map(|corner| points[corner]);
            (b - a).perp_dot(c - a)
        };
        let areas: Vec<f64> = triangles.iter().map(twice_area).collect();
        (0.5 * areas.iter().map(|area| area.abs()).sum::<f64>(), cut.crosses_itself)
    }

    const U: [[f64; 2]; 8] =
        [[0., 0.], [12., 0.], [12., 10.], [8., 10.], [8., 4.], [4., 4.], [4., 10.], [0., 10.]];

    #[test]
    fn the_triangles_cover_the_polygon_from_whichever_corner_it_begins() {
        // By hand: 12 x 10 less 4 x 6; 4 x 4 less the triangle below the notch.
        let notch = [[0., 0.], [4., 0.], [4., 4.], [2., 1.], [0., 4.]];
        // A square with a square hole, which a bridge joins to its outside.
        let hole = [
            [0., 0.],
            [6., 0.],
            [6., 6.],
            [0., 6.],
            [0., 0.],
            [2., 2.],
            [2., 4.],
            [4., 4.],
            [4., 2.],
            [2., 2.],
        ];
        // Sixteen tips at radius 2 and as many notches at radius 1.
        let star: Vec<[f64; 2]> = (0..32)
            .map(|i| {
                let (y, x) = (f64::from(i) * TAU / 32.0).sin_cos();
                let radius = f64::from(1 + i % 2);
                [radius * x, radius * y]
            })
            .collect();
        let star_area = 32.0 * 0.5 * 2.0 * (TAU / 32.0).sin();
        let cases: [(&[[f64; 2]], f64); 4] =
            [(&U, 96.0), (&notch, 10.0), (&hole, 32.0), (&star, star_area)];
        for (corners, expected) in cases {
            for first in 0..corners.len() {
                let mut corners = corners.to_vec();
                corners.rotate_left(first);
                for _ in 0..2 {
                    let (found, crosses_itself) = area(&corners);
                    assert!((found - expected).abs() < 1e-12 * expected, "{found}: {corners:?}");
                    assert!(!crosses_itself, "{corners:?}");
                    corners.reverse();
                }
            }
        }
    }

    #[test]
    fn a_cut_turns_as_its_polygon_in_every_plane_at_every_size_and_place() {
        for axes in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            for (scale, offset) in [(1.0, 0.0), (1e300, 0.0), (1e-300, 0.0), (1.0, 1e6)] {
                let point = |[x, y]: [f64; 2]| {
                    let place = [x, y, 0.3 * x + 0.5 * y];
                    DVec3::from_array(axes.map(|axis| place[axis] * scale + offset))
                };
                let corners = U.map(point);
                let cut = cut(corners.to_vec());
                assert!(!cut.crosses_itself && !cut.is_uneven, "{cut:?}");
                let normal = |[a, b, c]: [usize; 3]| {
                    let [a, b, c] = [a, b, c].map(|corner| corners[corner] / scale);
                    (b - a).cross(c - a)
                };
                // The U turns to the left, as its first three corners do.
                let up = normal([0, 1, 2]).normalize();
                let areas = cut.triangles.unwrap().into_iter().map(|t| 0.5 * normal(t).dot(up));
                let areas: Vec<f64> = areas.collect();
                assert!(areas.iter().all(|area| *area > 0.0), "{areas:?}");
                let expected = 96.0 * DVec3::new(-0.3, -0.5, 1.0).length();
                assert!((areas.iter().sum::<f64>() / expected - 1.0).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn polygon_that_a_fan_covers_stays_a_fan() {
        let square = [[0., 0.], [2., 0.], [2., 2.], [0., 2.]];
        // With corners on straight sides, with equal corners, and a notch that corner 0 sees.
        let straight = [[0., 0.], [1., 0.], [2., 0.], [2., 2.], [0., 2.], [0., 1.]];
        let doubled = [[0., 0.], [0., 0.], [2., 0.], [2., 2.], [2., 2.], [0., 2.]];
        let seen = [[2., 1.], [0., 4.], [0., 0.], [4., 0.], [4., 4.]];
        let point = [[1., 1.]; 5];
        let line = [[0., 0.], [1., 0.], [2., 0.], [1., 0.]];
        for corners in [&square[..], &straight, &doubled, &seen, &point, &line] {
            let corners = corners.iter().map(|[x, y]| DVec3::new(*x, *y, 1.0)).collect();
            assert_eq!(cut(corners), Cut::default());
        }
    }

    #[test]
    fn crossing_and_uneven_polygons_are_found() {
        let bow_tie = [[0., 0.], [1., 1.], [1., 0.], [0., 1.]];
        let lopsided = [[0., 0.], [2., 2.], [2., 0.], [0., 1.]];
        let pentagram = [0, 2, 4, 1, 3].map(|i| {
            let (y, x) = (f64::from(i) * TAU / 5.0).sin_cos();
            [x, y]
        });
        // A strip that passes over itself, turning to the left all the way.
        let ring = [
            [0., 0.],
            [4., 0.],
            [4., 3.],
            [1., 3.],
            [1., -1.],
            [2., -1.],
            [2., 2.],
            [3., 2.],
            [3., 1.],
            [0., 1.],
        ];
        for corners in [&bow_tie[..], &lopsided, &pentagram, &ring] {
            assert!(area(corners).1, "{corners:?}");
        }
        for (height, is_uneven) in [(0.01, false), (0.1, true)] {
            let lifted = [[0., 0., 0.], [1., 0., 0.], [1., 1., height], [0., 1., 0.]];
            let cut = cut(lifted.map(DVec3::from_array).to_vec());
            assert_eq!(cut, Cut { is_uneven, ..Cut::default() });
        }
    }
}
