//! What files say of points beside x, y and z: the names of the columns, and their units.

use super::Cloud;

/// What a column beside x, y and z holds.
#[derive(Clone, Copy)]
pub(super) enum Extra {
    Intensity(Unit),
    Ring,
}

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

/// The usual names of the column of intensities, in upper or lower case, the best first. CloudCompare
/// writes the last but one.
const INTENSITIES: [(&str, Unit); 4] = [
    ("intensity", Unit::Own),
    ("i", Unit::Own),
    ("scalar_intensity", Unit::Own),
    ("reflectivity", Unit::Percent),
];

/// The usual names of the column of rings. CloudCompare writes the second.
const RINGS: [&str; 2] = ["ring", "scalar_ring"];

/// The columns of intensities and rings, which `column` finds by their names.
pub(super) fn find<T>(mut column: impl FnMut(&str) -> Option<T>) -> Vec<(T, Extra)> {
    let intensity =
        INTENSITIES.iter().find_map(|(name, unit)| Some((column(name)?, Extra::Intensity(*unit))));
    let ring = RINGS.iter().find_map(|name| Some((column(name)?, Extra::Ring)));
    intensity.into_iter().chain(ring).collect()
}

impl Unit {
    /// The intensities of these numbers, if they are any.
    fn intensities(self, mut values: Vec<f32>) -> Option<Vec<f32>> {
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

/// The rings that these numbers are; `None` if one is no ring.
fn rings(values: &[f32]) -> Option<Vec<u16>> {
    let ring = |&x: &f32| (x.fract() == 0.0 && (0.0..65536.0).contains(&x)).then_some(x as u16);
    values.iter().map(ring).collect()
}

/// Points as they are read: x, y and z, and what else the file has of each.
#[derive(Default)]
pub(super) struct Rows {
    points: Vec<[f64; 3]>,
    extras: Vec<(Vec<f32>, Extra)>,
}

impl Rows {
    /// No points so far, which have these columns after x, y and z.
    pub fn new(extras: impl IntoIterator<Item = Extra>) -> Self {
        let extras = extras.into_iter().map(|extra| (Vec::new(), extra)).collect();
        Self { points: Vec::new(), extras }
    }

    /// Adds a point.
    pub fn push(&mut self, row: &[f64]) {
        self.points.push([row[0], row[1], row[2]]);
        for ((column, _), &x) in self.extras.iter_mut().zip(&row[3..]) {
            column.push(x as f32);
        }
    }

    /// The points so far.
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The cloud.
    pub fn cloud(self) -> Cloud {
        let mut cloud = Cloud { points: self.points, ..Cloud::default() };
        self.extras.into_iter().for_each(|(values, extra)| cloud.set(extra, values));
        cloud
    }
}

impl Cloud {
    /// Sets what a column holds.
    pub(super) fn set(&mut self, extra: Extra, values: Vec<f32>) {
        match extra {
            Extra::Intensity(unit) => self.intensities = unit.intensities(values),
            Extra::Ring => self.rings = rings(&values),
        }
    }
}
