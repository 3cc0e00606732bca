//! What a training needs, and what it reports.

use std::path::Path;

use crate::clouds::Clouds;
use crate::metrics::Epoch;
use crate::recipe::Recipe;

/// Trains one model.
pub struct Job<'a> {
    /// The settings of the training.
    pub recipe: Recipe,
    /// The training and validation clouds.
    pub clouds: &'a Clouds,
    /// Where the clouds come from, for errors.
    pub data: &'a str,
    /// The name of the training set on the model's card.
    pub data_name: &'a str,
    /// The model file. The run's folder is beside it.
    pub out: &'a Path,
    /// Whether to begin anew instead of resuming the run in that folder.
    pub overwrite: bool,
}

/// What a run reports while it trains.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'a> {
    /// The run continues after the last epoch of its checkpoint.
    Resumed {
        /// The number of finished epochs.
        epoch: u32,
        /// The number of epochs of the whole run.
        epochs: u32,
    },
    /// An epoch is finished and validated.
    Epoch(&'a Epoch),
}
