//! Checkpoints: the exact parameters, running statistics and moments of Adam, in one safetensors
//! file.

use std::path::Path;

use formats::FormatError;
use formats::weights::{Tensor, WeightsFile, write_weights};
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::layer::Module;
use crate::metrics::Epoch;
use crate::model_file;
use crate::parameter::Parameter;
use crate::recipe::{Recipe, Schedule};
use crate::trainer::Trainer;

const MEAN: &str = ".adam_mean";
const SQUARE: &str = ".adam_square";
const STATE: &str = "state";

/// What a checkpoint holds besides arrays, as TOML in its metadata.
#[derive(Serialize, Deserialize)]
struct State {
    step: u64,
    epoch: u32,
    /// The digest of the training data.
    data: String,
    recipe: Recipe,
    epochs: Vec<Epoch>,
}

/// Writes the state of `trainer`, its data's `digest` and the finished `epochs` to `path`,
/// atomically.
pub fn write(
    path: &Path,
    trainer: &mut Trainer,
    digest: &str,
    epochs: &[Epoch],
) -> Result<(), Error> {
    let mut tensors = model_file::tensors(&mut trainer.model);
    for parameter in trainer.model.parameters() {
        for (suffix, values) in [(MEAN, &parameter.mean), (SQUARE, &parameter.square)] {
            let tensor = Tensor { shape: parameter.shape.clone(), values: values.clone() };
            tensors.insert(format!("{}{suffix}", parameter.name), tensor);
        }
    }
    let Trainer { step, epoch, recipe, .. } = trainer;
    let (data, epochs) = (digest.to_owned(), epochs.to_vec());
    let state = State { step: *step, epoch: *epoch, data, recipe: recipe.clone(), epochs };
    let state = toml::to_string(&state).expect("invariant: the recipe is TOML");
    Ok(write_weights(path, &tensors, &[(STATE.to_owned(), state)].into())?)
}

/// Sets `trainer`, whose data have this `digest`, to the checkpoint at `path`. Returns the finished
/// epochs.
pub fn read(path: &Path, trainer: &mut Trainer, digest: &str) -> Result<Vec<Epoch>, Error> {
    let mut file = WeightsFile::open(path)?;
    let text = file.metadata().remove(STATE).unwrap_or_default();
    let State { step, epoch, data, recipe, epochs } = toml::from_str(&text)
        .map_err(|error| FormatError::malformed(path, "metadata `state`", error.to_string()))?;
    // The number of epochs may differ if the schedule does not depend on it.
    let is_free = matches!(recipe.schedule, Schedule::Step { .. });
    let n_epochs = if is_free { trainer.recipe.epochs } else { recipe.epochs };
    if (Recipe { epochs: n_epochs, ..recipe }) != trainer.recipe {
        return Err(other_run(path, "its recipe differs"));
    }
    if data != digest {
        return Err(other_run(path, "its training data differ"));
    }
    if epoch > trainer.recipe.epochs {
        let cause = format!("expected at most {} epochs, found {epoch}", trainer.recipe.epochs);
        return Err(other_run(path, &cause));
    }
    for Parameter { name, shape, value, mean, square, .. } in trainer.model.parameters() {
        for (suffix, values) in [("", value), (MEAN, mean), (SQUARE, square)] {
            model_file::read_into(&mut file, &format!("{name}{suffix}"), shape, values)?;
        }
    }
    model_file::read_statistics(&mut file, &mut trainer.model)?;
    (trainer.step, trainer.epoch) = (step, epoch);
    Ok(epochs)
}

fn other_run(path: &Path, cause: &str) -> Error {
    let way = "choose another --out, or remove it";
    Error::data(path, format!("expected a checkpoint of this run: {cause}; {way}"))
}
