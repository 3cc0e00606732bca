//! The profile of an Ouster sensor, from its metadata.

use std::num::NonZeroU32;
use std::path::Path;

use formats::ouster::Metadata;

use super::{Beam, Layout, RangeLimits, Rotating, SensorProfile};
use crate::config::{ConfigError, InvalidValue};

/// The farthest range that 19 bits of millimetres hold, metres.
const FARTHEST_M: f64 = 524.0;

/// Reads the metadata in `file`. The sensor's frame is Ouster's lidar frame.
pub(super) fn load(file: &Path) -> Result<SensorProfile, ConfigError> {
    let metadata = Metadata::read_beams(file).map_err(|error| {
        let message = error.to_string();
        let bare = message.strip_prefix(&format!("{}: ", file.display())).unwrap_or(&message);
        ConfigError::Content { file: file.to_owned(), message: bare.to_owned() }
    })?;
    let flaw = |key: &str, cause: String| ConfigError::value(file, InvalidValue::new(key, cause));
    let [start_m, height_m] = metadata.origin_m;
    if height_m != 0.0 {
        let cause = format!("expected beams that begin at height 0, found {height_m} m");
        return Err(flaw("beam_to_lidar_transform", cause));
    }
    if metadata.n_columns_unsent() > 0 {
        let unsent = metadata.n_columns_unsent();
        let cause = format!("expected all columns of a turn, found {unsent} that are not sent");
        return Err(flaw("column_window", cause));
    }
    let rate_hz = metadata.rate_hz;
    let columns = f64::from(metadata.columns_per_frame);
    let beam = metadata.beams_deg.iter().map(|&[elevation_deg, azimuth_deg]| Beam {
        // The head turns clockwise; a beam's azimuth counts clockwise from where it points.
        azimuth_offset_deg: -azimuth_deg,
        elevation_deg,
        firing_us: 0.0,
    });
    let rotating = Rotating {
        rpm: 60.0 * rate_hz,
        sequence_us: 1e6 / (rate_hz * columns),
        sequence_quantum_deg: None,
        beam_crossing_m: None,
        beam_start_m: Some(start_m),
        beam: beam.collect(),
    };
    rotating
        .validate()
        .map_err(|InvalidValue { key, cause }| flaw(&format!("as a profile, {key}"), cause))?;
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(SensorProfile {
        name,
        description: format!("Ouster of {} beams", metadata.beams_deg.len()),
        sources: vec![file.display().to_string()],
        range: RangeLimits {
            min_m: 0.0,
            max_m: FARTHEST_M,
            quantum_m: Some(metadata.range_unit_m()),
        },
        noise: None,
        detection: None,
        footprint: None,
        layout: Layout::Rotating(rotating),
        decimation: NonZeroU32::MIN,
        revolutions: NonZeroU32::MIN,
    })
}
