//! Surfaces that are uneven: foliage, stones, bark, old walls.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::primitives::{Builder, Sampler};

/// Waves that a ripple is the sum of: enough to show no pattern.
const N_WAVES: usize = 12;
/// Segments around a lump: chords lie within 1.3 % of the radius of the round
/// surface.
const N_AROUND: usize = 20;

/// A direction, all of them equally likely.
pub fn direction(s: &mut Sampler) -> DVec3 {
    let z = s.uniform(-1.0, 1.0);
    let (sin, cos) = s.uniform(0.0, TAU).sin_cos();
    let across = (1.0 - z * z).sqrt();
    DVec3::new(across * cos, across * sin, z)
}

/// A height that varies smoothly and irregularly from place to place.
pub struct Ripple {
    /// The wave vectors, radians a metre, and the phases.
    waves: Vec<(DVec3, f64)>,
    amplitude_m: f64,
}

impl Ripple {
    /// Heights of standard deviation `deviation_m`, in waves of half to twice
    /// `length_m`.
    pub fn draw(s: &mut Sampler, length_m: f64, deviation_m: f64) -> Self {
        let mut wave = || {
            let length_m = length_m * s.log_uniform(0.5, 2.0);
            (TAU / length_m * direction(s), s.uniform(0.0, TAU))
        };
        let waves = (0..N_WAVES).map(|_| wave()).collect();
        // A sine's variance is a half, and the waves are independent.
        Self { waves, amplitude_m: deviation_m * (2.0 / N_WAVES as f64).sqrt() }
    }

    /// The height at `place`, metres.
    pub fn at(&self, place: DVec3) -> f64 {
        let sum: f64 = self.waves.iter().map(|(k, phase)| (k.dot(place) + phase).sin()).sum();
        self.amplitude_m * sum
    }
}

/// A round body, an ellipsoid or a box with soft edges, which is flat where it
/// would reach below the ground at height 0.
pub struct Lump {
    /// The middle.
    pub centre: DVec3,
    /// Half the sizes.
    pub radii_m: DVec3,
    /// 2 for an ellipsoid, 4 and more towards a box.
    pub exponent: f64,
    /// How far the surface lies outside.
    pub ripple: Ripple,
}

impl Lump {
    /// The point of the surface in a direction from the middle.
    pub fn at(&self, direction: DVec3) -> DVec3 {
        let power = |value: f64| value.abs().powf(self.exponent);
        let sum = power(direction.x) + power(direction.y) + power(direction.z);
        let smooth = direction * sum.powf(-1.0 / self.exponent) * self.radii_m;
        let out = smooth.normalize_or(DVec3::Z);
        let point = self.centre + smooth + self.ripple.at(self.centre + smooth) * out;
        point.with_z(point.z.max(0.0))
    }

    /// Adds the surface, which nothing passes.
    pub fn build(&self, b: &mut Builder) {
        let row = |j: usize| {
            let (sin, cos) = (j as f64 / (N_AROUND / 2) as f64 * PI).sin_cos();
            let n = if j == 0 || j == N_AROUND / 2 { 1 } else { N_AROUND };
            let point = |i: usize| {
                let (y, x) = (i as f64 / N_AROUND as f64 * TAU).sin_cos();
                self.at(DVec3::new(sin * x, sin * y, -cos))
            };
            (0..n).map(point).collect()
        };
        let rows: Vec<Vec<DVec3>> = (0..=N_AROUND / 2).map(row).collect();
        b.grid(&rows, true);
    }
}

/// The five faces of the box of `size_m` on the ground that are seen, each
/// point moved by `warp`, with edges of about `edge_m`.
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
    /// The upper side.
    Top,
}

impl BoxFace {
    /// All but the lower side.
    pub const SEEN: [Self; 5] =
        [Self::End(1.0), Self::End(-1.0), Self::Side(1.0), Self::Side(-1.0), Self::Top];

    /// The face's width and height on a box of `size_m`.
    pub fn size_m(self, size_m: DVec3) -> [f64; 2] {
        match self {
            Self::End(_) => [size_m.y, size_m.z],
            Self::Side(_) => [size_m.x, size_m.z],
            Self::Top => [size_m.x, size_m.y],
        }
    }

    /// The point of the face at `u` and `v` in 0..=1; faces look outwards.
    pub fn at(self, size_m: DVec3, u: f64, v: f64) -> DVec3 {
        let [across, up] = [u - 0.5, v - 0.5];
        let unit = match self {
            Self::End(side) => DVec3::new(0.5 * side, across * side, v),
            Self::Side(side) => DVec3::new(-across * side, 0.5 * side, v),
            Self::Top => DVec3::new(across, up, 1.0),
        };
        unit * size_m
    }
}
