//! Closed outlines in a plane, counter-clockwise, for lofts and sweeps.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3, dvec2, dvec3};

pub fn ellipse(half: DVec2, n: usize) -> Vec<DVec2> {
    superellipse(half, 2.0, n)
}

/// A superellipse |x/a|^e + |y/b|^e = 1: an ellipse at `exponent` 2, nearly a rectangle from 6 on.
pub fn superellipse(half: DVec2, exponent: f64, n: usize) -> Vec<DVec2> {
    let power = |value: f64| value.signum() * libm::pow(value.abs(), 2.0 / exponent);
    (0..n)
        .map(|k| libm::sincos(k as f64 / n as f64 * TAU))
        .map(|(sin, cos)| dvec2(power(cos), power(sin)) * half)
        .collect()
}

pub fn rectangle(half: DVec2) -> Vec<DVec2> {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| dvec2(x, y) * half).to_vec()
}

/// A rectangle with corners of `radius` in `n_corner` segments each; `radius` is at most half the
/// shorter side.
pub fn rounded_rectangle(half: DVec2, radius: f64, n_corner: usize) -> Vec<DVec2> {
    let radius = radius.min(half.min_element());
    let inner = half - DVec2::splat(radius);
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
    let mut outline = Vec::with_capacity(4 * (n_corner + 1));
    for (quarter, (x, y)) in corners.into_iter().enumerate() {
        for k in 0..=n_corner {
            let angle_rad = (quarter as f64 + k as f64 / n_corner as f64) * FRAC_PI_2;
            outline.push(dvec2(x, y) * inner + radius * DVec2::from_angle(angle_rad));
        }
    }
    outline
}

/// A symmetric wing section of chord 1 from the nose (x = 0) to the tail (x = 1) and back below,
/// with `n` segments a side and a sharp tail.
///
/// The NACA four-digit thickness law (Jacobs, Ward and Pinkerton, NACA report 460, 1933). The last
/// coefficient is 0.1036 instead of 0.1015, the usual value for a closed tail.
pub fn airfoil(thickness: f64, n: usize) -> Vec<DVec2> {
    let half_thickness = |x: f64| {
        5.0 * thickness
            * (0.2969 * x.sqrt() + x * (-0.1260 + x * (-0.3516 + x * (0.2843 + x * -0.1036))))
    };
    // Cosine spacing puts more points where the nose bends.
    let station = |k: usize| 0.5 - 0.5 * libm::cos(k as f64 / n as f64 * TAU / 2.0);
    let lower = (0..n).map(|k| (station(k), -1.0));
    let upper = (1..=n).rev().map(|k| (station(k), 1.0));
    lower.chain(upper).map(|(x, side)| dvec2(x, side * half_thickness(x).max(0.0))).collect()
}

/// An upright rectangle across x, between the heights `low` and `high`.
pub fn upright(x: f64, half_y: f64, [low, high]: [f64; 2]) -> Vec<DVec3> {
    [(-half_y, low), (-half_y, high), (half_y, high), (half_y, low)]
        .map(|(y, z)| dvec3(x, y, z))
        .to_vec()
}

/// An outline in the plane across x about `centre`; its x points along y, its y upwards.
pub fn across_x(outline: &[DVec2], centre: DVec3) -> Vec<DVec3> {
    outline.iter().map(|p| centre + dvec3(0.0, p.x, p.y)).collect()
}

pub fn at_height(outline: &[DVec2], z: f64) -> Vec<DVec3> {
    outline.iter().map(|p| p.extend(z)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(outline: &[DVec2]) -> f64 {
        let next = outline.iter().cycle().skip(1);
        outline.iter().zip(next).map(|(a, b)| a.perp_dot(*b) / 2.0).sum()
    }

    #[test]
    fn outlines_run_counter_clockwise_and_enclose_their_areas() {
        let half = dvec2(2.0, 1.0);
        // An inscribed polygon of n sides lacks (2 pi / n)^2 / 6 of the area: 1e-3 of it at n = 80.
        let pi = TAU / 2.0;
        assert!((area(&ellipse(half, 80)) / (2.0 * pi) - 1.0).abs() < 1.1e-3);
        assert_eq!(area(&rectangle(half)), 8.0);
        let rounded = area(&rounded_rectangle(half, 0.5, 20));
        assert!((rounded - (8.0 - (4.0 - pi) * 0.25)).abs() < 1e-3);
    }

    #[test]
    fn an_airfoil_is_as_thick_as_asked_and_closes_at_the_tail() {
        let section = airfoil(0.12, 200);
        let thickest = section.iter().map(|p| p.y).fold(0.0, f64::max);
        // Report 460: half of 12 % at 30 % chord, read to three digits.
        assert!((thickest - 0.06).abs() < 1e-4, "{thickest}");
        let tail = section.iter().find(|p| p.x == 1.0).map(|p| p.y);
        assert!(tail.is_some_and(|y| y.abs() < 1e-12));
        assert!(area(&section) > 0.0);
    }
}
