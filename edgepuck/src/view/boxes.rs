//! Boxes in the JSON files of `detect`, `live` and `gen-scenes`.

use std::path::Path;

use formats::FormatError;
use formats::boxes::{BoxOfFile, read_boxes};
use formats::plausible::read_text;

use super::frame::Placed;

/// The truth of the sweep that `gen-scenes` describes in `file`; none if the file is another's.
pub fn described(file: &Path) -> Result<Vec<Placed>, FormatError> {
    let text = read_text(file, u64::MAX).map_err(|source| FormatError::io(file, source))?;
    if text.contains("\"sensor_pose\"") { read(file) } else { Ok(Vec::new()) }
}

/// Reads the boxes in `file`.
pub fn read(file: &Path) -> Result<Vec<Placed>, FormatError> {
    let placed = |one: BoxOfFile| Placed {
        class: one.class,
        place: one.place,
        score: one.score,
        track: one.track,
        truth: one.is_truth,
        turn: one.turn,
        sweep: one.sweep,
        in_world: one.in_world,
        seen_from: None,
        time_s: one.time_s,
    };
    Ok(read_boxes(file)?.into_iter().map(placed).collect())
}
