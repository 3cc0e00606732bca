//! What came and what did not.

/// Packets, returns and clusters since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Packets that were decoded.
    pub packets: u64,
    /// Packets that are missing by the time stamps of those that came.
    pub lost: u64,
    /// Packets that came after a later one.
    pub late: u64,
    /// Packets that came twice.
    pub duplicated: u64,
    /// Packets that are not the sensor's data: of another length or model, or damaged.
    pub foreign: u64,
    /// How often the sensor or its clock began anew, the first time aside.
    pub restarts: u64,
    /// Returns that were decoded.
    pub points: u64,
    /// Returns that are in no column, because they came late or there was no room.
    pub dropped_points: u64,
    /// Clusters that were answered.
    pub clusters: u64,
    /// Of those, clusters of too few points to be classified.
    pub unclassified: u64,
}
