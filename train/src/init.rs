//! Starts training from a model's weights instead of random numbers.
//!
//! All layers but the last take the model's weights. The last layer takes them, too, if the model's
//! classes are the first classes of the network; the weights of the other classes stay random.
//!
//! A shipped model has no batch norms, since they are folded into its linear layers. A new batch
//! norm with scale 1 and shift 0 would undo the folding, because training normalises each batch.
//! Therefore the mean and the standard deviation of a layer's outputs on the training clouds become
//! the running statistics of its batch norm, and also its shift and scale. The network then gives
//! the model's outputs: exactly with the running statistics, and approximately with the statistics
//! of a batch.

use std::collections::BTreeSet;
use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{WeightsFile, tensor_part};

use crate::batches;
use crate::clouds::Clouds;
use crate::error::Error;
use crate::layer::{EPSILON, LayerMut, Module, Norm};
use crate::model::Model;
use crate::network::Rates;
use crate::parameter::Parameter;
use crate::point_encoder::TRAINING_ONLY;
use crate::recipe::Recipe;
use crate::trainer::Trainer;

/// Number of clouds from which the statistics of the batch norms are computed.
const CLOUDS: usize = 256;

/// Sets the network of `trainer`, whose card is `card`, to the model at `path`.
pub fn start(
    trainer: &mut Trainer,
    path: &Path,
    card: &ModelCard,
    clouds: &Clouds,
) -> Result<(), Error> {
    let (mut file, model) = infer_cpu::model_file::open(path)?;
    check_card(path, card, &model)?;
    let mut reader = Reader { file: &mut file, used: BTreeSet::new() };
    let is_known = !model.classes.is_empty() && card.classes.starts_with(&model.classes);
    let n_known = is_known.then_some(model.classes.len());
    let is_folded = reader.network(&mut trainer.model, n_known)?;
    reader.check_that_all_is_used()?;
    if is_folded {
        unfold(&mut trainer.model, &trainer.recipe, clouds);
    }
    Ok(())
}

fn check_card(path: &Path, wanted: &ModelCard, found: &ModelCard) -> Result<(), FormatError> {
    // The card of an imported model may lack the number of points.
    let found = ModelCard { points: found.points.or(wanted.points), ..found.clone() };
    for ((key, wanted), (_, found)) in facts(wanted).into_iter().zip(facts(&found)) {
        if wanted != found {
            let cause = format!("expected {wanted}, as the recipe has it, found {found}");
            return Err(FormatError::malformed(path, format!("metadata `{key}`"), cause));
        }
    }
    Ok(())
}

fn facts(card: &ModelCard) -> [(&'static str, String); 6] {
    [
        ("normalization", card.normalization.to_string()),
        ("points", card.points.unwrap_or_default().to_string()),
        ("edge_radii", format!("{:?}", card.edge_radii)),
        ("abstractions", format!("{:?}", card.abstractions)),
        ("transform_after", card.transform_after.to_string()),
        ("pooled", if card.pooled_relu { "relu" } else { "linear" }.to_owned()),
    ]
}

struct Reader<'a> {
    file: &'a mut WeightsFile,
    used: BTreeSet<String>,
}

impl Reader<'_> {
    /// Reads all layers of `model`. Of the last layer, only the first `n_known` classes are read.
    /// Returns whether the file lacks batch norms, because they are folded.
    fn network(&mut self, model: &mut Model, n_known: Option<usize>) -> Result<bool, FormatError> {
        let layers: Vec<LayerMut<'_>> = model.layers();
        let (n, mut is_folded) = (layers.len(), false);
        for (place, LayerMut { linear, norm, .. }) in layers.into_iter().enumerate() {
            if linear.name() == TRAINING_ONLY {
                continue;
            }
            if place + 1 == n {
                for parameter in [&mut linear.weight, &mut linear.bias] {
                    match n_known {
                        Some(n_known) => self.first_rows(parameter, n_known)?,
                        None => _ = self.used.insert(parameter.name.clone()),
                    }
                }
                continue;
            }
            self.parameter(&mut linear.weight)?;
            self.parameter(&mut linear.bias)?;
            let Some(norm) = norm else { continue };
            if self.file.shape(&norm.scale.name).is_some() {
                self.norm(norm)?;
            } else {
                is_folded = true;
            }
        }
        Ok(is_folded)
    }

    fn norm(&mut self, norm: &mut Norm) -> Result<(), FormatError> {
        self.parameter(&mut norm.scale)?;
        self.parameter(&mut norm.shift)?;
        let width = norm.mean.len();
        for (name, values) in norm.statistics() {
            *values = self.tensor(&name, &[width])?;
        }
        Ok(())
    }

    fn parameter(&mut self, parameter: &mut Parameter) -> Result<(), FormatError> {
        parameter.value = self.tensor(&parameter.name, &parameter.shape)?;
        Ok(())
    }

    fn first_rows(&mut self, parameter: &mut Parameter, n: usize) -> Result<(), FormatError> {
        let shape = [&[n], &parameter.shape[1..]].concat();
        let rows = self.tensor(&parameter.name, &shape)?;
        parameter.value[..rows.len()].copy_from_slice(&rows);
        Ok(())
    }

    fn tensor(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>, FormatError> {
        self.used.insert(name.to_owned());
        let found = self.file.shape(name);
        // PyTorch's one-dimensional convolutions have a third axis, of one element.
        if found.is_some_and(|found| found.strip_suffix(&[1]).unwrap_or(found) == shape)
            || found == Some(shape)
        {
            return Ok(self.file.read(name)?.values);
        }
        let found = found.map_or("none".to_owned(), |found| format!("{found:?}"));
        let cause = format!("expected shape {shape:?}, as the recipe has it, found {found}");
        Err(FormatError::malformed(self.file.path(), tensor_part(name), cause))
    }

    fn check_that_all_is_used(&self) -> Result<(), FormatError> {
        let names = self.file.shapes().into_keys();
        let is_left =
            |name: &String| !self.used.contains(name) && !name.ends_with(".num_batches_tracked");
        names.into_iter().find(is_left).map_or(Ok(()), |name| {
            let cause = "expected the tensors of the recipe's network, found one more";
            Err(FormatError::malformed(self.file.path(), tensor_part(&name), cause))
        })
    }
}

/// Sets all batch norms so that they change nothing on average. The layers come in order, because
/// the inputs of a layer depend on the batch norms before it.
fn unfold(model: &mut Model, recipe: &Recipe, clouds: &Clouds) {
    let drawn = Recipe { batch: CLOUDS, clouds_per_epoch: Some(CLOUDS), ..recipe.clone() };
    let batch = std::thread::scope(|scope| batches::start(scope, clouds, &drawn, 0).recv());
    let batch = batch.expect("invariant: an epoch of one batch");
    let rates = Rates { momentum: 1.0, orthogonality: 0.0 };
    for place in 0..model.layers().len() {
        model.learn(&batch, None, rates);
        if let Some(norm) = model.layers().swap_remove(place).norm {
            norm.shift.value.clone_from(&norm.mean);
            let deviations = norm.variance.iter().map(|variance| (variance + EPSILON).sqrt());
            norm.scale.value = deviations.collect();
        }
    }
}
