/// The part of the sweep that a point belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// The ground.
    Ground,
    /// The cluster with this index in [`Segmentation::clusters`](crate::Segmentation::clusters).
    Cluster(u32),
    /// No cluster: the point is out of range, or its set has too few or too many points, or is too
    /// large.
    Small,
    /// A coordinate is NaN or infinite, or the point lies at the sensor's origin.
    Invalid,
}

impl Label {
    /// Not ground, and not assigned to a cluster yet.
    pub(crate) const OBSTACLE: Self = Self::Cluster(u32::MAX);
}
