//! What type coordinates are written in.

use std::io::{self, Write};

use crate::number::NumberType;

/// The type of the coordinates of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// Every coordinate is an f32.
    Single,
    /// Some are not.
    Double,
}

impl Precision {
    /// What holds `points` without loss.
    pub fn of(points: &[[f64; 3]]) -> Self {
        let is_single = |x: &f64| f64::from(*x as f32) == *x || x.is_nan();
        if points.as_flattened().iter().all(is_single) { Self::Single } else { Self::Double }
    }

    /// Bytes of a coordinate.
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
