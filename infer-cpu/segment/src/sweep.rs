//! The input of a segmentation, and why it is refused.

/// The points of one sweep of a sensor, or of several stacked closely.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// Metres, in the sensor's frame: its origin is the sensor, z points up.
    pub points: &'a [[f32; 3]],
    /// The ring of each point, counted from the lowest elevation; any other numbers work as well,
    /// one for each laser, because rows are sorted by their elevation.
    pub rings: Option<&'a [u16]>,
}

impl<'a> Sweep<'a> {
    /// The rings; `None` if all points have the same one, as in a column that nobody filled.
    pub(crate) fn distinct_rings(&self) -> Option<&'a [u16]> {
        self.rings.filter(|rings| rings.iter().any(|ring| *ring != rings[0]))
    }
}

/// A sweep that cannot be segmented.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentError {
    /// Not one ring for each point.
    #[error("expected {expected} rings, one for each point, found {found}")]
    RingCount {
        /// The number of points of the sweep.
        expected: usize,
        /// The number of its ring values.
        found: usize,
    },
    /// More rings than sensors have.
    #[error("expected at most {most} different rings, found {found}")]
    TooManyRings {
        /// The largest supported number.
        most: usize,
        /// The number in the sweep.
        found: usize,
    },
    /// A ring whose elevation the settings do not state.
    #[error("expected rings below {expected}, as many as there are elevations, found {found}")]
    UnknownRing {
        /// The number of elevations.
        expected: usize,
        /// A ring of the sweep.
        found: usize,
    },
    /// More points than their indices can count.
    #[error("expected at most 4,294,967,294 points, found {0}")]
    TooManyPoints(usize),
}
