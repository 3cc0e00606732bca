//! Checkpoint and resume: parameters, running statistics and Adam's moments, to
//! the bit, in one safetensors file.

use std::collections::BTreeMap;
use std::path::Path;

use formats::FormatError;
use formats::weights::{Tensor, WeightsFile, write_weights};

use crate::error::Error;
use crate::layer::Module;
use crate::model_file;
use crate::recipe::Recipe;
use crate::trainer::Trainer;

const MEAN: &str = ".adam_mean";
const SQUARE: &str = ".adam_square";

/// Writes the state of `trainer` to `path`, atomically, with `notes`.
///
/// # Errors
/// What the system reports.
pub fn write(path: &Path, trainer: &mut Trainer, notes: &str) -> Result<(), Error> {
    let mut tensors = model_file::tensors(&mut trainer.model);
    trainer.model.parameters(&mut |parameter| {
        for (suffix, values) in [(MEAN, &parameter.mean), (SQUARE, &parameter.square)] {
            let tensor = Tensor { shape: parameter.shape.clone(), values: values.clone() };
            tensors.insert(format!("{}{suffix}", parameter.name), tensor);
        }
    });
    let metadata = [
        ("recipe", trainer.recipe.to_toml()?),
        ("step", trainer.step.to_string()),
        ("epoch", trainer.epoch.to_string()),
        ("notes", notes.to_owned()),
    ];
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value)).into();
    Ok(write_weights(path, &tensors, &metadata)?)
}

/// Sets `trainer` to the state in the checkpoint at `path`; returns its notes.
///
/// # Errors
/// A file that is not a checkpoint, or a checkpoint of another recipe.
pub fn read(path: &Path, trainer: &mut Trainer) -> Result<String, Error> {
    let mut file = WeightsFile::open(path)?;
    let metadata = file.metadata();
    let text = |key: &str| {
        metadata.get(key).cloned().ok_or_else(|| {
            FormatError::malformed(
                path,
                format!("metadata `{key}`"),
                "missing, although every checkpoint has it",
            )
        })
    };
    let number = |key: &str| -> Result<u64, Error> {
        let value = text(key)?;
        let bad = |_| {
            FormatError::malformed(path, format!("metadata `{key}`"), "expected a whole number")
        };
        Ok(value.parse().map_err(bad)?)
    };
    check_recipe(path, &text("recipe")?, &trainer.recipe)?;
    let mut tensors: BTreeMap<String, Tensor> = BTreeMap::new();
    for name in file.shapes().into_keys() {
        let tensor = file.read(&name)?;
        tensors.insert(name, tensor);
    }
    let mut missing = None;
    let mut take = |name: String, into: &mut Vec<f32>| match tensors.remove(&name) {
        Some(tensor) if tensor.values.len() == into.len() => *into = tensor.values,
        _ => missing = Some(name),
    };
    trainer.model.parameters(&mut |parameter| {
        take(parameter.name.clone(), &mut parameter.value);
        take(format!("{}{MEAN}", parameter.name), &mut parameter.mean);
        take(format!("{}{SQUARE}", parameter.name), &mut parameter.square);
    });
    trainer.model.statistics(&mut |name, values| take(name.to_owned(), values));
    if let Some(name) = missing {
        let cause = "missing or of another shape";
        return Err(FormatError::malformed(path, format!("tensor `{name}`"), cause).into());
    }
    trainer.step = number("step")?;
    trainer.epoch = number("epoch")? as u32;
    text("notes").map_err(Error::from)
}

/// Only the number of epochs may change, and only if the schedule does not
/// depend on it.
fn check_recipe(path: &Path, before: &str, now: &Recipe) -> Result<(), Error> {
    let before: Recipe = toml::from_str(before)
        .map_err(|error| FormatError::malformed(path, "metadata `recipe`", error.to_string()))?;
    let of_any_length = matches!(now.schedule, crate::recipe::Schedule::Step { .. });
    let epochs = if of_any_length { now.epochs } else { before.epochs };
    if (Recipe { epochs, ..before }) != *now {
        return Err(Error::OtherRun {
            path: path.to_path_buf(),
            cause: "its recipe differs; choose another --out, or remove it".to_owned(),
        });
    }
    Ok(())
}
