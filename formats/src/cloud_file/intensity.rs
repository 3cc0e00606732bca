//! The intensities of points: the names of their columns, and their units.

use super::Cloud;

/// What the numbers in a column of intensities are.
#[derive(Clone, Copy)]
pub(super) enum Unit {
    /// The file's own unit.
    Own,
    /// Whole numbers up to 255 are percent of a white surface, as in [`crate::Scan::reflectivity`];
    /// others are of the file's own unit.
    Percent,
    /// 65535 is the most (LAS 1.4 R15, 2.6.2), and only 0 is "not included". Files without a number
    /// above 255 break this rule: they have the sensor's bytes, of the file's own unit.
    #[cfg(feature = "las")]
    Las,
}

/// The usual names of the column, in upper or lower case, the best first. CloudCompare writes the last
/// but one.
const NAMES: [(&str, Unit); 4] = [
    ("intensity", Unit::Own),
    ("i", Unit::Own),
    ("scalar_intensity", Unit::Own),
    ("reflectivity", Unit::Percent),
];

/// The column of intensities, which `column` finds by its name.
pub(super) fn find<T>(mut column: impl FnMut(&str) -> Option<T>) -> Option<(T, Unit)> {
    NAMES.iter().find_map(|(name, unit)| Some((column(name)?, *unit)))
}

impl Unit {
    /// The intensities of these numbers, if they are any.
    pub fn intensities(self, mut values: Vec<f32>) -> Option<Vec<f32>> {
        let most = values.iter().copied().fold(0.0, f32::max);
        let is_byte = |x: &f32| x.is_nan() || x.fract() == 0.0 && (0.0..256.0).contains(x);
        let white = match self {
            Self::Percent if most > 1.0 && values.iter().all(is_byte) => 100.0,
            #[cfg(feature = "las")]
            Self::Las if most == 0.0 => return None,
            #[cfg(feature = "las")]
            Self::Las if most > 255.0 => 65535.0,
            _ => return Some(values),
        };
        values.iter_mut().for_each(|value| *value /= white);
        Some(values)
    }
}

/// Points as they are read: x, y and z, and perhaps an intensity.
#[derive(Default)]
pub(super) struct Rows {
    points: Vec<[f64; 3]>,
    intensities: Vec<f32>,
}

impl Rows {
    /// Adds a point, of three or four numbers.
    pub fn push(&mut self, row: &[f64]) {
        self.points.push([row[0], row[1], row[2]]);
        self.intensities.extend(row.get(3).map(|&x| x as f32));
    }

    /// The points so far.
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The cloud, with intensities if the rows have them, which are of this unit.
    pub fn cloud(self, unit: Option<Unit>) -> Cloud {
        let intensities = unit.and_then(|unit| unit.intensities(self.intensities));
        Cloud { points: self.points, intensities }
    }
}
