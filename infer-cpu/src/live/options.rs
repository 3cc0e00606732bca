use edgepuck_segment::Settings;
use formats::geometry::Trajectory;
use formats::ouster::Metadata;

/// The options of a pipeline.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LiveOptions {
    /// The fewest points of an object with a class.
    pub min_points: usize,
    /// In how many clusters an object has been seen when it is first reported; at least 1.
    pub min_turns: u64,
    /// The settings of the segmentation.
    pub segmentation: Settings,
    /// The poses of the sensor in the world by Unix time, if known.
    pub ego_motion: Option<Trajectory>,
    /// The metadata of an Ouster; without it, the sensor is a Velodyne.
    pub ouster: Option<Metadata>,
    /// Whether the packets come from a recording, whose times of arrival may have been changed
    /// since. Then the sensor's stamps give the intervals between packets.
    pub is_recorded: bool,
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self {
            min_points: 20,
            min_turns: 2,
            segmentation: Settings::default(),
            ego_motion: None,
            ouster: None,
            is_recorded: false,
        }
    }
}
