/// Packets, returns and clusters since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Packets that were decoded.
    pub packets: u64,
    /// Packets that are missing according to the time stamps of the others.
    pub lost: u64,
    /// Packets that came after a later one.
    pub late: u64,
    /// Packets that came twice.
    pub duplicated: u64,
    /// Packets that are not the sensor's data: of another length or model, or damaged.
    pub foreign: u64,
    /// The number of restarts of the sensor or its clock.
    pub restarts: u64,
    /// Returns that were decoded.
    pub points: u64,
    /// Returns that were dropped because they came late or there was no room.
    pub dropped_points: u64,
    /// Clusters that were reported.
    pub clusters: u64,
    /// Reported clusters that had too few points to be classified.
    pub unclassified: u64,
}
