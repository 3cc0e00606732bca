//! Scans: the points that one sensor measures in one revolution or frame.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::error::FormatError;

/// The keys of [`Scan::object_texts`] in files.
pub const OBJECT_TEXTS: [&str; 2] = ["object_names", "object_labels"];

/// The points of one scan, perhaps none. Every attribute that is present has one value for each
/// position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// An offset to add to every position, metres. It is zero in most scans; a scene
    /// 1e7 m from the world's origin keeps its micrometres by it.
    pub origin: [f64; 3],
    /// The end points of the beams in the world's frame, metres from `origin`.
    pub positions: Vec<[f32; 3]>,
    /// The transform from the sensor's frame to the world's when the scan began, a matrix of 4 by 4
    /// row by row, metres; `None` if it is the identity or not known.
    pub pose: Option<[f64; 16]>,
    /// Distance from the start of the beam, which is at the sensor or near it, metres.
    pub range_m: Option<Vec<f32>>,
    /// Number of the beam in the sensor's firing order.
    pub beam: Option<Vec<u32>>,
    /// Row of the beam, counted from the lowest elevation.
    pub ring: Option<Vec<u16>>,
    /// Seconds since the revolution began. At 0.1 s, a revolution's end at
    /// 600 rpm, f32 resolves 8 ns; lasers fire 2.3 microseconds apart.
    pub time_s: Option<Vec<f32>>,
    /// Index of the triangle that was hit, in its mesh file's order.
    pub triangle: Option<Vec<u32>>,
    /// Index of the object that was hit, in the scene's order.
    pub object: Option<Vec<u32>>,
    /// The names of the objects by their indices, and the labels of their classes, each empty if none is
    /// known.
    pub object_texts: [Vec<String>; 2],
    /// Returned intensity, 0 to 1.
    pub intensity: Option<Vec<f32>>,
    /// Received power, relative to that of a white surface that faces the sensor 1 m away:
    /// it falls with the square of the range.
    pub power: Option<Vec<f32>>,
    /// Calibrated reflectivity, independent of the range, as Velodyne's sensors report it: 0 to
    /// 100 are percent of a white surface that faces the sensor, 101 to 255 retro-reflectors.
    pub reflectivity: Option<Vec<u8>>,
    /// Number of the return among the detected returns of its beam, from 1, the nearest.
    pub return_number: Option<Vec<u8>>,
    /// What reflected the beam: 0 a surface, 1 rain, 2 snow, 3 fog, 4 dust or spray. Points of
    /// the air have triangle and object 2^32 - 1 and normal 0.
    pub medium: Option<Vec<u8>>,
    /// Position of the sensor when the beam was fired, metres from `origin`.
    pub sensor_m: Option<Vec<[f32; 3]>>,
    /// Attitude of the sensor at that time: the rotation from its frame to the world's, as a
    /// vector along the axis whose length is the angle in radians.
    pub attitude_rad: Option<Vec<[f32; 3]>>,
    /// Unit normal of the surface, towards the sensor, in the world's frame.
    pub normal: Option<Vec<[f32; 3]>>,
}

crate::named! {
    /// An attribute of points besides their position, in the order of columns in files.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Attribute: "attribute" {
        /// [`Scan::range_m`].
        Range = "range",
        /// [`Scan::beam`].
        Beam = "beam",
        /// [`Scan::ring`].
        Ring = "ring",
        /// [`Scan::time_s`].
        Time = "time",
        /// [`Scan::triangle`].
        Triangle = "triangle",
        /// [`Scan::object`].
        Object = "object",
        /// [`Scan::intensity`].
        Intensity = "intensity",
        /// [`Scan::power`].
        Power = "power",
        /// [`Scan::reflectivity`].
        Reflectivity = "reflectivity",
        /// [`Scan::return_number`].
        Return = "return",
        /// [`Scan::medium`].
        Medium = "medium",
        /// [`Scan::sensor_m`].
        Sensor = "sensor",
        /// [`Scan::attitude_rad`].
        Attitude = "attitude",
        /// [`Scan::normal`].
        Normal = "normal",
    }
}

/// Attributes, in the order of columns in files.
pub type AttributeSet = BTreeSet<Attribute>;

/// The values of one attribute, one for each point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Column<'a> {
    /// Real numbers.
    F32(&'a [f32]),
    /// Bytes.
    U8(&'a [u8]),
    /// Small whole numbers.
    U16(&'a [u16]),
    /// Whole numbers.
    U32(&'a [u32]),
    /// Vectors.
    Vector(&'a [[f32; 3]]),
}

impl Column<'_> {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::U8(values) => values.len(),
            Self::U16(values) => values.len(),
            Self::U32(values) => values.len(),
            Self::Vector(values) => values.len(),
        }
    }
}

/// The place where a reader stores the values of one attribute.
pub enum ColumnSlot<'a> {
    /// Real numbers.
    F32(&'a mut Option<Vec<f32>>),
    /// Bytes.
    U8(&'a mut Option<Vec<u8>>),
    /// Small whole numbers.
    U16(&'a mut Option<Vec<u16>>),
    /// Whole numbers.
    U32(&'a mut Option<Vec<u32>>),
    /// Vectors.
    Vector(&'a mut Option<Vec<[f32; 3]>>),
}

impl ColumnSlot<'_> {
    /// Stores the `numbers` of all points, three for each vector; the error names one of another type.
    #[cfg(feature = "dataset")]
    pub(crate) fn set(self, numbers: &[f64]) -> Result<(), String> {
        match self {
            Self::F32(slot) => *slot = Some(numbers.iter().map(|&x| x as f32).collect()),
            Self::U8(slot) => *slot = Some(all_whole(numbers)?),
            Self::U16(slot) => *slot = Some(all_whole(numbers)?),
            Self::U32(slot) => *slot = Some(all_whole(numbers)?),
            Self::Vector(slot) => {
                let vectors = numbers.as_chunks::<3>().0.iter();
                *slot = Some(vectors.map(|vector| vector.map(|x| x as f32)).collect());
            }
        }
        Ok(())
    }
}

#[cfg(feature = "dataset")]
fn all_whole<T: TryFrom<u32>>(numbers: &[f64]) -> Result<Vec<T>, String> {
    numbers.iter().map(|&x| whole(x)).collect()
}

/// The whole number `x`, if the type has it.
#[cfg(feature = "dataset")]
fn whole<T: TryFrom<u32>>(x: f64) -> Result<T, String> {
    let is_u32 = x.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&x);
    let fits = is_u32.then_some(x as u32).and_then(|n| T::try_from(n).ok());
    let bits = 8 * size_of::<T>();
    fits.ok_or_else(|| format!("expected a whole number of {bits} bits, found {x}"))
}

/// What [`pose_of`] takes.
pub(crate) const POSE: &str =
    "expected the 16 numbers of a rotation and a translation, with 0, 0, 0, 1 as the last row";

/// The pose of these numbers, row by row.
pub(crate) fn pose_of(numbers: &[f64]) -> Option<[f64; 16]> {
    let pose: [f64; 16] = numbers.try_into().ok()?;
    let row = |i: usize| [pose[4 * i], pose[4 * i + 1], pose[4 * i + 2]];
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
    let [x, y, z] = [row(0), row(1), row(2)];
    let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    // Poses of f32, multiplied some times, are rotations within this.
    let is_near = |a: f64, b: f64| (a - b).abs() < 1e-3;
    let is_rotation =
        [x, y, z].iter().all(|row| is_near(dot(*row, *row), 1.0)) && is_near(dot(cross, z), 1.0);
    let is_pose =
        is_rotation && pose.iter().all(|x| x.is_finite()) && pose[12..] == [0.0, 0.0, 0.0, 1.0];
    is_pose.then_some(pose)
}

/// Beyond this, f32 resolves less than half a millimetre.
const FARTHEST_SINGLE_M: f64 = 8192.0;

impl Scan {
    /// A scan of `points` without attributes, from an origin near them if they are far from 0.
    #[must_use]
    pub fn of_points(points: &[[f64; 3]]) -> Self {
        let first = points.iter().find(|point| point.iter().all(|x| x.is_finite()));
        let is_far = points.iter().flatten().any(|x| x.is_finite() && x.abs() > FARTHEST_SINGLE_M);
        let origin = match first {
            Some(first) if is_far => first.map(f64::round),
            _ => [0.0; 3],
        };
        let place = |point: &[f64; 3]| [0, 1, 2].map(|axis| (point[axis] - origin[axis]) as f32);
        Self { origin, positions: points.iter().map(place).collect(), ..Self::default() }
    }

    /// The position of the sensor when the scan began, metres, in the world.
    #[must_use]
    pub fn sensor_position_m(&self) -> [f64; 3] {
        self.pose.map_or([0.0; 3], |pose| [pose[3], pose[7], pose[11]])
    }

    /// The number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether the scan has no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The points at these indices, in their order, with all attributes.
    ///
    /// # Panics
    /// If an index is not below the number of points.
    #[must_use]
    pub fn select(&self, numbers: &[usize]) -> Self {
        fn picked<T: Copy>(values: &[T], numbers: &[usize]) -> Vec<T> {
            numbers.iter().map(|&i| values[i]).collect()
        }
        let positions = picked(&self.positions, numbers);
        let mut selected =
            Self { origin: self.origin, pose: self.pose, positions, ..Self::default() };
        selected.object_texts.clone_from(&self.object_texts);
        for (attribute, column) in self.columns() {
            match (selected.slot(attribute), column) {
                (ColumnSlot::F32(slot), Column::F32(all)) => *slot = Some(picked(all, numbers)),
                (ColumnSlot::U8(slot), Column::U8(all)) => *slot = Some(picked(all, numbers)),
                (ColumnSlot::U16(slot), Column::U16(all)) => *slot = Some(picked(all, numbers)),
                (ColumnSlot::U32(slot), Column::U32(all)) => *slot = Some(picked(all, numbers)),
                (ColumnSlot::Vector(slot), Column::Vector(all)) => {
                    *slot = Some(picked(all, numbers))
                }
                _ => unreachable!("invariant: a column and its slot are of one type"),
            }
        }
        selected
    }

    /// The values of one attribute, if the scan has them.
    #[must_use]
    pub fn column(&self, attribute: Attribute) -> Option<Column<'_>> {
        match attribute {
            Attribute::Range => self.range_m.as_deref().map(Column::F32),
            Attribute::Beam => self.beam.as_deref().map(Column::U32),
            Attribute::Ring => self.ring.as_deref().map(Column::U16),
            Attribute::Time => self.time_s.as_deref().map(Column::F32),
            Attribute::Triangle => self.triangle.as_deref().map(Column::U32),
            Attribute::Object => self.object.as_deref().map(Column::U32),
            Attribute::Intensity => self.intensity.as_deref().map(Column::F32),
            Attribute::Power => self.power.as_deref().map(Column::F32),
            Attribute::Reflectivity => self.reflectivity.as_deref().map(Column::U8),
            Attribute::Return => self.return_number.as_deref().map(Column::U8),
            Attribute::Medium => self.medium.as_deref().map(Column::U8),
            Attribute::Sensor => self.sensor_m.as_deref().map(Column::Vector),
            Attribute::Attitude => self.attitude_rad.as_deref().map(Column::Vector),
            Attribute::Normal => self.normal.as_deref().map(Column::Vector),
        }
    }

    /// The place of the values of one attribute.
    pub fn slot(&mut self, attribute: Attribute) -> ColumnSlot<'_> {
        match attribute {
            Attribute::Range => ColumnSlot::F32(&mut self.range_m),
            Attribute::Beam => ColumnSlot::U32(&mut self.beam),
            Attribute::Ring => ColumnSlot::U16(&mut self.ring),
            Attribute::Time => ColumnSlot::F32(&mut self.time_s),
            Attribute::Triangle => ColumnSlot::U32(&mut self.triangle),
            Attribute::Object => ColumnSlot::U32(&mut self.object),
            Attribute::Intensity => ColumnSlot::F32(&mut self.intensity),
            Attribute::Power => ColumnSlot::F32(&mut self.power),
            Attribute::Reflectivity => ColumnSlot::U8(&mut self.reflectivity),
            Attribute::Return => ColumnSlot::U8(&mut self.return_number),
            Attribute::Medium => ColumnSlot::U8(&mut self.medium),
            Attribute::Sensor => ColumnSlot::Vector(&mut self.sensor_m),
            Attribute::Attitude => ColumnSlot::Vector(&mut self.attitude_rad),
            Attribute::Normal => ColumnSlot::Vector(&mut self.normal),
        }
    }

    /// The attributes that the scan has, in the order of columns in files.
    pub fn columns(&self) -> impl Iterator<Item = (Attribute, Column<'_>)> {
        Attribute::ALL
            .into_iter()
            .filter_map(|attribute| Some((attribute, self.column(attribute)?)))
    }

    /// Checks that every attribute has one value for each point.
    ///
    /// # Errors
    /// [`FormatError::Length`] for the first attribute of another length.
    pub fn check_lengths(&self) -> Result<(), FormatError> {
        let expected = self.len();
        match self.columns().find(|(_, column)| column.len() != expected) {
            None => Ok(()),
            Some((attribute, column)) => Err(FormatError::Length {
                attribute: attribute.name(),
                expected,
                found: column.len(),
            }),
        }
    }
}

impl Attribute {
    /// The attribute's columns in PLY and CSV files: its own name, or three for a vector.
    #[cfg(feature = "dataset")]
    pub(crate) fn column_names(self) -> Vec<&'static str> {
        match self {
            Self::Normal => vec!["nx", "ny", "nz"],
            Self::Sensor => vec!["sensor_x", "sensor_y", "sensor_z"],
            Self::Attitude => vec!["attitude_x", "attitude_y", "attitude_z"],
            other => vec![other.name()],
        }
    }
}
