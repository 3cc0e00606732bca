//! Checkpoints: the exact parameters, running statistics and moments of Adam, in one safetensors
//! file.

use std::path::Path;

use formats::FormatError;
use formats::weights::{Tensor, WeightsFile, write_weights};

use crate::error::Error;
use crate::layer::Module;
use crate::model_file;
use crate::parameter::Parameter;
use crate::recipe::{Recipe, Schedule};
use crate::trainer::Trainer;

const MEAN: &str = ".adam_mean";
const SQUARE: &str = ".adam_square";
const AVERAGE: &str = ".average";

/// Writes the state of `trainer`, its data's `digest` and `notes` to `path`, atomically.
pub fn write(path: &Path, trainer: &mut Trainer, digest: &str, notes: &str) -> Result<(), Error> {
    let mut tensors = model_file::tensors(&mut trainer.model);
    for parameter in trainer.model.parameters() {
        for (suffix, values) in [(MEAN, &parameter.mean), (SQUARE, &parameter.square)] {
            let tensor = Tensor { shape: parameter.shape.clone(), values: values.clone() };
            tensors.insert(format!("{}{suffix}", parameter.name), tensor);
        }
    }
    let averages = trainer.averages.iter();
    tensors.extend(averages.map(|(name, tensor)| (format!("{name}{AVERAGE}"), tensor.clone())));
    let metadata = [
        ("recipe", trainer.recipe.to_toml()?),
        ("step", trainer.step.to_string()),
        ("epoch", trainer.epoch.to_string()),
        ("data", digest.to_owned()),
        ("notes", notes.to_owned()),
    ];
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value)).into();
    Ok(write_weights(path, &tensors, &metadata)?)
}

/// Sets `trainer`, whose data have this `digest`, to the checkpoint at `path`. Returns its notes.
pub fn read(path: &Path, trainer: &mut Trainer, digest: &str) -> Result<String, Error> {
    let mut file = WeightsFile::open(path)?;
    let metadata = file.metadata();
    let bad =
        |key: &str, cause: &str| FormatError::malformed(path, format!("metadata `{key}`"), cause);
    let text = |key: &str| {
        let missing = || bad(key, "missing, although every checkpoint has it");
        metadata.get(key).cloned().ok_or_else(missing)
    };
    let number = |key: &str| -> Result<u64, FormatError> {
        text(key)?.parse().map_err(|_| bad(key, "expected a whole number"))
    };
    check_recipe(path, &text("recipe")?, &trainer.recipe)?;
    if metadata.get("data").is_none_or(|data| data != digest) {
        return Err(other_run(path, "its training data differ"));
    }
    let epoch = number("epoch")? as u32;
    if epoch > trainer.recipe.epochs {
        let cause = format!("expected at most {} epochs, found {epoch}", trainer.recipe.epochs);
        return Err(other_run(path, &cause));
    }
    for Parameter { name, value, mean, square, .. } in trainer.model.parameters() {
        model_file::read_into(&mut file, name, value)?;
        model_file::read_into(&mut file, &format!("{name}{MEAN}"), mean)?;
        model_file::read_into(&mut file, &format!("{name}{SQUARE}"), square)?;
    }
    for (name, values) in trainer.model.statistics() {
        model_file::read_into(&mut file, &name, values)?;
    }
    if trainer.recipe.average > 0.0 {
        for name in model_file::tensors(&mut trainer.model).into_keys() {
            let average = file.read(&format!("{name}{AVERAGE}"))?;
            trainer.averages.insert(name, average);
        }
    }
    trainer.step = number("step")?;
    trainer.epoch = epoch;
    Ok(text("notes")?)
}

/// Checks that the recipe is that of the checkpoint. The number of epochs may differ if the
/// schedule does not depend on it.
fn check_recipe(path: &Path, before: &str, now: &Recipe) -> Result<(), Error> {
    let before: Recipe = toml::from_str(before)
        .map_err(|error| FormatError::malformed(path, "metadata `recipe`", error.to_string()))?;
    let epochs_may_differ = matches!(now.schedule, Schedule::Step { .. });
    let epochs = if epochs_may_differ { now.epochs } else { before.epochs };
    if (Recipe { epochs, ..before }) != *now {
        return Err(other_run(path, "its recipe differs"));
    }
    Ok(())
}

fn other_run(path: &Path, cause: &str) -> Error {
    let cause = format!("{cause}; choose another --out, or remove it");
    Error::OtherRun { path: path.to_path_buf(), cause }
}
