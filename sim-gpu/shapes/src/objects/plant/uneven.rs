//! Uneven surfaces: foliage, stones, bark, old walls.

use std::f64::consts::{PI, TAU};

use crate::primitives::{Builder, DVec3, Sampler, dvec3};

/// The number of waves in a ripple, enough to show no pattern.
const N_WAVES: usize = 12;
/// The number of segments around a lump. Its chords deviate by up to 1.3 % of the radius from the
/// round surface.
const N_AROUND: usize = 20;

/// A random direction, uniform on the sphere.
pub fn direction(s: &mut Sampler) -> DVec3 {
    let z = s.uniform(-1.0, 1.0);
    let (sin, cos) = libm::sincos(s.uniform(0.0, TAU));
    let across = (1.0 - z * z).sqrt();
    dvec3(across * cos, across * sin, z)
}

/// A height that varies smoothly and irregularly with the place.
pub struct Ripple {
    /// The wave vectors, radians a metre, and the phases.
    waves: Vec<(DVec3, f64)>,
    amplitude_m: f64,
}

impl Ripple {
    /// Heights of standard deviation `deviation_m`, in waves of half to twice `length_m`.
    pub fn draw(s: &mut Sampler, length_m: f64, deviation_m: f64) -> Self {
        let mut wave = || {
            let length_m = length_m * s.log_uniform(0.5, 2.0);
            (TAU / length_m * direction(s), s.uniform(0.0, TAU))
        };
        let waves = (0..N_WAVES).map(|_| wave()).collect();
        // The variance of a sine is 1/2, and the waves are independent.
        Self { waves, amplitude_m: deviation_m * (2.0 / N_WAVES as f64).sqrt() }
    }

    pub fn at(&self, place: DVec3) -> f64 {
        let sum: f64 = self.waves.iter().map(|(k, phase)| libm::sin(k.dot(place) + phase)).sum();
        self.amplitude_m * sum
    }
}

/// An ellipsoid or a box with soft edges. The part below height 0 is moved up to the ground.
pub struct Lump {
    pub centre: DVec3,
    pub radii_m: DVec3,
    /// 2 for an ellipsoid; 4 and more approach a box.
    pub exponent: f64,
    /// The offset of the surface outwards.
    pub ripple: Ripple,
}

impl Lump {
    /// The point of the surface in a direction from the middle.
    pub fn at(&self, direction: DVec3) -> DVec3 {
        let power = |value: f64| libm::pow(value.abs(), self.exponent);
        let sum = power(direction.x) + power(direction.y) + power(direction.z);
        let smooth = direction * libm::pow(sum, -1.0 / self.exponent) * self.radii_m;
        let out = smooth.normalize_or(DVec3::Z);
        let point = self.centre + smooth + self.ripple.at(self.centre + smooth) * out;
        point.with_z(point.z.max(0.0))
    }

    /// Adds the surface, which is opaque.
    pub fn build(&self, b: &mut Builder) {
        let row = |j: usize| {
            let (sin, cos) = libm::sincos(j as f64 / (N_AROUND / 2) as f64 * PI);
            let n = if j == 0 || j == N_AROUND / 2 { 1 } else { N_AROUND };
            let point = |i: usize| {
                let (y, x) = libm::sincos(i as f64 / N_AROUND as f64 * TAU);
                self.at(dvec3(sin * x, sin * y, -cos))
            };
            (0..n).map(point).collect()
        };
        let rows: Vec<Vec<DVec3>> = (0..=N_AROUND / 2).map(row).collect();
        b.grid(&rows, true);
    }
}

/// The faces of the box of `size_m` on the ground, except the lower one. `warp` moves each point;
/// edges have about the length `edge_m`.
pub fn warped_box(b: &mut Builder, size_m: DVec3, edge_m: f64, warp: impl Fn(DVec3) -> DVec3) {
    for face in BoxFace::SEEN {
        let [across_m, up_m] = face.size_m(size_m);
        let segments = |length_m: f64| (length_m / edge_m).round().max(5.0) as usize;
        b.surface([segments(across_m), segments(up_m)], |u, v| warp(face.at(size_m, u, v)));
    }
}

/// A face of a box that stands on the ground at the origin.
#[derive(Clone, Copy)]
pub enum BoxFace {
    /// The side towards +x or -x.
    End(f64),
    /// The side towards +y or -y.
    Side(f64),
    Top,
}

impl BoxFace {
    /// All but the lower side.
    pub const SEEN: [Self; 5] =
        [Self::End(1.0), Self::End(-1.0), Self::Side(1.0), Self::Side(-1.0), Self::Top];

    pub fn size_m(self, size_m: DVec3) -> [f64; 2] {
        match self {
            Self::End(_) => [size_m.y, size_m.z],
            Self::Side(_) => [size_m.x, size_m.z],
            Self::Top => [size_m.x, size_m.y],
        }
    }

    /// The point of the face at `u` and `v` in 0..=1. Front faces look outwards.
    pub fn at(self, size_m: DVec3, u: f64, v: f64) -> DVec3 {
        let [across, up] = [u - 0.5, v - 0.5];
        let unit = match self {
            Self::End(side) => dvec3(0.5 * side, across * side, v),
            Self::Side(side) => dvec3(-across * side, 0.5 * side, v),
            Self::Top => dvec3(across, up, 1.0),
        };
        unit * size_m
    }
}
