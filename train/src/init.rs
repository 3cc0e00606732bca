//! Starts training from a model's weights instead of random numbers.
//!
//! All layers but the last take the model's weights. The last layer takes them, too, if the model
//! has the classes of the data.
//!
//! A shipped model has no batch norms, since they are folded into its linear layers. Training adds
//! them again with scale 1 and shift 0, so that they undo the folding. On Sydney's objects, a network
//! learnt alike with each layer's mean and deviation in their place (assets/reports/reality/sydney.md).

use std::collections::BTreeSet;
use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::tensor_part;

use crate::error::Error;
use crate::layer::{LayerMut, Module};
use crate::model::Model;
use crate::model_file::read_into;
use crate::parameter::Parameter;
use crate::point_encoder::TRAINING_ONLY;

/// Sets `network`, whose card is `card`, to the model at `path`.
pub fn start(network: &mut Model, path: &Path, card: &ModelCard) -> Result<(), Error> {
    let (mut file, found) = infer_cpu::model_file::open(path)?;
    check_card(path, card, &found)?;
    let mut left: BTreeSet<String> = file.shapes().into_keys().collect();
    left.retain(|name| !name.ends_with(".num_batches_tracked"));
    let has_norms = left.iter().any(|name| name.ends_with(".running_mean"));
    let mut layers = network.layers();
    if found.classes != card.classes
        && let Some(last) = layers.pop()
    {
        left.remove(&last.linear.weight.name);
        left.remove(&last.linear.bias.name);
    }
    for LayerMut { linear, norm, .. } in layers {
        if linear.name() == TRAINING_ONLY {
            continue;
        }
        let mut read = |name: &str, shape: &[usize], values: &mut Vec<f32>| {
            left.remove(name);
            read_into(&mut file, name, shape, values)
        };
        for Parameter { name, shape, value, .. } in [&mut linear.weight, &mut linear.bias] {
            read(name, shape, value)?;
        }
        let Some(norm) = norm.filter(|_| has_norms) else { continue };
        for Parameter { name, shape, value, .. } in [&mut norm.scale, &mut norm.shift] {
            read(name, shape, value)?;
        }
        for (name, values) in norm.statistics() {
            read(&name, &[values.len()], values)?;
        }
    }
    left.first().map_or(Ok(()), |name| {
        let cause = "expected the tensors of the recipe's network, found one more";
        Err(FormatError::malformed(path, tensor_part(name), cause).into())
    })
}

fn check_card(path: &Path, wanted: &ModelCard, found: &ModelCard) -> Result<(), FormatError> {
    let facts = |card: &ModelCard| {
        let pooled = if card.pooled_relu { "relu" } else { "linear" }.to_owned();
        [
            ("normalization", card.normalization.to_string()),
            // The card of an imported model may lack the number of points.
            ("points", card.points.or(wanted.points).unwrap_or_default().to_string()),
            ("edge_radii", format!("{:?}", card.edge_radii)),
            ("pooled", pooled),
        ]
    };
    for ((key, wanted), (_, found)) in facts(wanted).into_iter().zip(facts(found)) {
        if wanted != found {
            let cause = format!("expected {wanted}, as the recipe has it, found {found}");
            return Err(FormatError::malformed(path, format!("metadata `{key}`"), cause));
        }
    }
    Ok(())
}
