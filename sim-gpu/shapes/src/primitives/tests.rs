use std::f64::consts::PI;

use glam::{DVec2, DVec3, dvec3};

use super::revolve::revolve;
use super::*;

/// The sum of a measure over the triangles that `build` makes with edges of `edge_m`.
fn sum(
    edge_m: f64,
    build: impl FnOnce(&mut Builder),
    of_triangle: impl Fn([DVec3; 3]) -> f64,
) -> f64 {
    let mut builder = Builder::new(edge_m, 1.0);
    build(&mut builder);
    let (mesh, _) = builder.finish();
    mesh.triangles.iter().map(|t| of_triangle(t.map(|i| mesh.vertices[i as usize]))).sum()
}

/// Asserts that `build` encloses `expected` cubic metres, within the relative `tolerance`. The
/// volume is positive only if front faces look outwards.
fn encloses(
    what: &str,
    edge_m: f64,
    (expected, tolerance): (f64, f64),
    build: impl FnOnce(&mut Builder),
) {
    let volume = sum(edge_m, build, |[a, b, c]| a.dot(b.cross(c)) / 6.0);
    let error = (volume / expected - 1.0).abs();
    assert!(error < tolerance, "{what}: expected a volume of {expected}, found {volume}");
}

/// Asserts that the surface of `build` is `expected` square metres.
fn covers(what: &str, edge_m: f64, expected: f64, build: impl FnOnce(&mut Builder)) {
    let area = sum(edge_m, build, |[a, b, c]| (b - a).cross(c - a).length() / 2.0);
    assert!((area - expected).abs() < 1e-9, "{what}: expected an area of {expected}, found {area}");
}

/// Sums of a few hundred terms of about 1, rounded at 1e-16 each.
const ROUNDING: f64 = 1e-12;

#[test]
fn flat_solids_enclose_their_volumes_however_finely_divided() {
    let square = outline::rectangle(DVec2::splat(0.5));
    let flat = |u: f64, v: f64| dvec3(2.0 * u, 3.0 * v, 0.0);
    let down = dvec3(0.0, 0.0, -0.1);
    for edge_m in [f64::INFINITY, 0.3] {
        let size = dvec3(1.0, 2.0, 3.0);
        encloses("block", edge_m, (6.0, ROUNDING), |b| block(b, DVec3::ONE, size));
        covers("block", edge_m, 22.0, |b| block(b, DVec3::ONE, size));
        encloses("prism", edge_m, (3.0, ROUNDING), |b| prism(b, &square, 1.0, 4.0, 1.0));
        // A frustum of a pyramid: h / 3 (A + sqrt(A B) + B).
        encloses("pyramid", edge_m, (1.75, ROUNDING), |b| prism(b, &square, 0.0, 3.0, 0.5));
        encloses("board", edge_m, (0.6, ROUNDING), |b| board(b, [2.0, 3.0], down, flat));
        covers("sheet", edge_m, 6.0, |b| sheet(b, [2.0, 3.0], flat));
    }
    // Twelve edges of length 2 lose (1 - pi / 4) 0.1^2 a metre: 0.0515.
    let cube = DVec3::splat(2.0);
    encloses("cushion", 0.05, (7.95, 2.5e-3), |b| cushion(b, DVec3::ZERO, cube, 0.1));
}

#[test]
fn solids_of_revolution_enclose_their_volumes() {
    // Chords of length e on a circle of radius r lack e^2 / (6 r^2) of its area; a sphere lacks it
    // in both directions: under 0.4 % at e = 0.1.
    encloses("cylinder", 0.1, (2.0 * PI, 4e-3), |b| cylinder(b, DVec3::ONE, 1.0, 2.0));
    let radii = dvec3(1.0, 2.0, 3.0) / 2.0;
    encloses("ellipsoid", 0.1, (PI, 4e-3), |b| ellipsoid(b, DVec3::X, radii));
    let profile = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(DVec2::from);
    for (section, area) in [
        (Section::Oval(0.5), 0.5 * PI),
        (Section::Polygon(4), 2.0),
        // Area of a superellipse of exponent 4: 4 Gamma(5/4)^2 / Gamma(3/2).
        (Section::Square(4.0), 3.7081),
        // The mean of (1 + d cos)^2 is 1 + d^2 / 2.
        (Section::Fluted { count: 8, depth: 0.1 }, PI * 1.005),
    ] {
        let what = format!("{section:?}");
        encloses(&what, 0.02, (area, 1e-3), |b| revolve(b, &profile, section, 0.0));
    }
}

#[test]
fn a_vessel_holds_the_volume_of_its_material_and_a_sheet_has_one_side() {
    let outside = Profile::from(0.0, 0.0).line(1.0, 0.0).line(1.0, 2.0);
    let pot = Vessel::new(outside, Wall::Solid(0.1), Section::Polygon(4));
    // A square of area 2 over a height of 2, less one of 2 * 0.9^2 over
    // 1.9; the inner edge of the floor is cut by at most the thickness.
    for edge_m in [0.1, f64::INFINITY] {
        encloses("pot", edge_m, (0.922, 0.12), |b| pot.build(b));
    }
    let outside = Profile::from(1.0, 0.0).line(1.0, 1.0);
    let ring = Vessel::new(outside, Wall::Sheet, Section::Polygon(4));
    covers("ring", 0.1, 4.0 * 2f64.sqrt(), |b| ring.build(b));
}

#[test]
fn a_rod_is_closed_whichever_way_it_points() {
    for to in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Z, dvec3(0.6, 0.0, 0.8)] {
        // Sixty-three sides lack (2 pi / 63)^2 / 6 = 0.17 % of the disc.
        let exact = (PI * 0.01, 2e-3);
        encloses(&format!("to {to}"), 0.01, exact, |b| rod(b, DVec3::ZERO, to, [0.1, 0.1]));
    }
}

#[test]
fn a_level_bar_is_as_wide_and_high_as_asked() {
    let mut b = Builder::new(f64::INFINITY, 1.0);
    bar(&mut b, DVec3::ZERO, DVec3::X, 0.4, 0.1);
    let (mesh, _) = b.finish();
    let high = mesh.vertices.iter().copied().reduce(DVec3::max);
    assert!(high.is_some_and(|h| h.distance(dvec3(1.0, 0.2, 0.05)) < 1e-12), "{high:?}");
}
