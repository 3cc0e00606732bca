//! The type in which coordinates are written.

use std::io::{self, Write};

use crate::number::NumberType;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    Single,
    Double,
}

/// The tolerable rounding error as a fraction of a cloud's extent: a micrometre in a metre, far below
/// the error of any sensor.
const TOLERABLE: f64 = 1e-6;

impl Precision {
    /// The type that represents `points` exactly.
    pub fn lossless(points: &[[f64; 3]]) -> Self {
        let is_single = |x: &f64| f64::from(*x as f32) == *x || x.is_nan();
        if points.as_flattened().iter().all(is_single) { Self::Single } else { Self::Double }
    }

    /// The type that represents `points` to a millionth of the longest side of their box.
    pub fn tolerable(points: &[[f64; 3]]) -> Self {
        let loss = loss(points);
        // The error of a number beyond f32 is infinite, and never tolerable.
        if loss < f64::INFINITY && loss <= TOLERABLE * extent(points) {
            Self::Single
        } else {
            Self::Double
        }
    }

    pub fn size(self) -> usize {
        match self {
            Self::Single => NumberType::F32.size(),
            Self::Double => NumberType::F64.size(),
        }
    }

    /// Writes `points` as x, y, z, little-endian.
    pub fn write(self, writer: &mut impl Write, points: &[[f64; 3]]) -> io::Result<()> {
        points.as_flattened().iter().try_for_each(|&coordinate| match self {
            Self::Single => writer.write_all(&(coordinate as f32).to_le_bytes()),
            Self::Double => writer.write_all(&coordinate.to_le_bytes()),
        })
    }
}

/// The largest error of a coordinate as f32.
fn loss(points: &[[f64; 3]]) -> f64 {
    let finite = points.as_flattened().iter().filter(|x| x.is_finite());
    finite.map(|&x| (f64::from(x as f32) - x).abs()).fold(0.0, f64::max)
}

/// The longest side of the box around the coordinates that are finite.
fn extent(points: &[[f64; 3]]) -> f64 {
    let side = |axis: usize| {
        let along = || points.iter().map(|point| point[axis]).filter(|x| x.is_finite());
        let (low, high) =
            (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
        high - low
    };
    [0, 1, 2].map(side).into_iter().fold(0.0, f64::max)
}
