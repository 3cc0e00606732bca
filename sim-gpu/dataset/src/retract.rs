use crate::error::DatasetError;
use crate::layout;
use std::path::Path;

/// The card and the metadata of a published dataset.
pub const FILES: [&str; 2] = ["README.md", "croissant.json"];

/// The end of a card, by which [`retract`] recognises it.
pub const CLOSE: &str = "<!-- Written by `edgepuck card`. -->\n";

/// Removes the card and the metadata from `out`, since they do not describe the dataset that will
/// replace this one. A `README.md` that [`publish()`](crate::publish()) did not write stays.
pub fn retract(out: &Path) -> Result<(), DatasetError> {
    let [card, metadata] = FILES.map(|name| out.join(name));
    if !metadata.exists() {
        return Ok(());
    }
    layout::remove(&metadata)?;
    match std::fs::read_to_string(&card) {
        Ok(text) if text.ends_with(CLOSE) => layout::remove(&card),
        _ => Ok(()),
    }
}
