//! Surfaces of revolution, also with cross-sections other than circles.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DAffine3, DVec2, DVec3, dvec2, dvec3};

use super::{Builder, smooth};

/// The profile of a surface of revolution: a curve in (radius, height).
#[derive(Clone, Debug)]
pub struct Profile {
    corners: Vec<DVec2>,
    spans: Vec<Span>,
}

#[derive(Clone, Debug)]
enum Span {
    Line(DVec2),
    Curve(Vec<DVec2>),
}

impl Profile {
    pub fn from(radius_m: f64, height_m: f64) -> Self {
        Self { corners: vec![dvec2(radius_m, height_m)], spans: Vec::new() }
    }

    pub fn line(mut self, radius_m: f64, height_m: f64) -> Self {
        self.corners.push(dvec2(radius_m, height_m));
        self.spans.push(Span::Line(dvec2(radius_m, height_m)));
        self
    }

    /// Continues with a smooth curve through `points` of (radius, height).
    pub fn curve(mut self, points: &[(f64, f64)]) -> Self {
        let points: Vec<_> = points.iter().map(|&(r, z)| dvec2(r, z)).collect();
        self.corners.extend(points.last());
        self.spans.push(Span::Curve(points));
        self
    }

    /// Revolves the profile about the z axis. A profile that rises on the outside gives front faces
    /// that look outwards.
    pub fn revolve(&self, b: &mut Builder, section: Section) {
        let points = self.sample(b);
        revolve(b, &points, section, 0.0);
    }

    /// The profile as a polyline of (radius, height), with the builder's edge length.
    pub fn sample(&self, b: &Builder) -> Vec<DVec2> {
        let mut path = vec![self.corners[0]];
        for (start, span) in self.corners.iter().zip(&self.spans) {
            match span {
                Span::Line(end) => {
                    let n = b.straight(start.distance(*end));
                    path.extend((1..=n).map(|k| start.lerp(*end, k as f64 / n as f64)));
                }
                Span::Curve(points) => {
                    let through: Vec<_> =
                        std::iter::once(start).chain(points).map(|p| p.extend(0.0)).collect();
                    let curve = smooth(b, &through, 2);
                    path.extend(curve[1..].iter().map(|p| dvec2(p.x.max(0.0), p.y)));
                }
            }
        }
        path
    }
}

/// The cross-section of an upright surface.
#[derive(Clone, Copy, Debug)]
pub enum Section {
    Round,
    /// An ellipse; y is `ratio` times x.
    Oval(f64),
    /// A superellipse of this exponent: a square with soft corners.
    Square(f64),
    /// A regular polygon with sharp corners.
    Polygon(usize),
    /// A circle with `count` waves of relative `depth`.
    Fluted {
        count: usize,
        /// Half the waves' height over the radius.
        depth: f64,
    },
}

impl Section {
    fn segments(self, b: &Builder, radius_m: f64) -> usize {
        match self {
            Self::Polygon(sides) => sides * b.straight(TAU * radius_m / sides as f64),
            Self::Fluted { count, .. } => count * b.around(radius_m, 4 * count).div_ceil(count),
            Self::Square(_) => 4 * b.around(radius_m, 12).div_ceil(4),
            Self::Round | Self::Oval(_) => b.around(radius_m, 12),
        }
    }

    /// The point of the unit section at this angle.
    fn unit(self, angle_rad: f64) -> DVec2 {
        let direction = DVec2::from_angle(angle_rad);
        match self {
            Self::Round => direction,
            Self::Oval(ratio) => direction * dvec2(1.0, ratio),
            Self::Square(exponent) => {
                let sum =
                    libm::pow(direction.abs().x, exponent) + libm::pow(direction.abs().y, exponent);
                direction * libm::pow(sum, -1.0 / exponent)
            }
            Self::Polygon(sides) => {
                let sector_rad = TAU / sides as f64;
                let within_rad = angle_rad.rem_euclid(sector_rad) - sector_rad / 2.0;
                direction * libm::cos(sector_rad / 2.0) / libm::cos(within_rad)
            }
            Self::Fluted { count, depth } => {
                direction * (1.0 + depth * libm::cos(count as f64 * angle_rad))
            }
        }
    }
}

/// Revolves a polyline of (radius, height) about the z axis and twists the section by `twist_rad`
/// per metre of height. A point on the axis becomes a pole.
pub fn revolve(b: &mut Builder, profile: &[DVec2], section: Section, twist_rad: f64) {
    let widest_m = profile.iter().map(|p| p.x).fold(0.0, f64::max);
    let n = section.segments(b, widest_m);
    let rows: Vec<Vec<DVec3>> = profile
        .iter()
        .map(|p| {
            if p.x <= 1e-9 {
                return vec![dvec3(0.0, 0.0, p.y)];
            }
            let turn = DVec2::from_angle(twist_rad * p.y);
            let angle_rad = |k: usize| k as f64 / n as f64 * TAU;
            (0..n).map(|k| (p.x * turn.rotate(section.unit(angle_rad(k)))).extend(p.y)).collect()
        })
        .collect();
    b.grid(&rows, true);
}

/// An upright cylinder with both ends closed.
pub fn cylinder(b: &mut Builder, base: DVec3, radius_m: f64, height_m: f64) {
    frustum(b, base, [radius_m, radius_m], height_m);
}

/// An upright closed frustum of a cone with these radii at its foot and its top.
pub fn frustum(b: &mut Builder, base: DVec3, radii_m: [f64; 2], height_m: f64) {
    let profile = Profile::from(0.0, 0.0)
        .line(radii_m[0], 0.0)
        .line(radii_m[1], height_m)
        .line(0.0, height_m);
    b.shifted(base, |b| profile.revolve(b, Section::Round));
}

pub fn ellipsoid(b: &mut Builder, centre: DVec3, radii_m: DVec3) {
    let widest_m = radii_m.max_element();
    let n = b.curved(FRAC_PI_2 * 2.0 * widest_m, 6);
    let meridian: Vec<_> = (0..=n)
        .map(|k| libm::sincos(k as f64 / n as f64 * FRAC_PI_2 * 2.0))
        .map(|(sin, cos)| widest_m * dvec2(sin, -cos))
        .collect();
    let scaled = DAffine3::from_scale(radii_m / widest_m);
    b.place(DAffine3::from_translation(centre) * scaled, |b| {
        revolve(b, &meridian, Section::Round, 0.0);
    });
}
