//! Loads a network in any precision.

use std::sync::Arc;

use edgepuck_kernels::{F32, Format, I8, Kernels};
use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::WeightsFile;

use crate::classify::calibrate;
use crate::classify::options::Options;
use crate::engine::team::Team;
use crate::engine::{Engine, Forward};
use crate::error::Error;
use crate::model::layers;
use crate::model::network::Parts;
use crate::model::source::ModelSource;
use crate::precision::Precision;

pub struct Loaded {
    pub card: ModelCard,
    pub network: Box<dyn Forward>,
    /// The optional parts that it has.
    pub parts: Parts,
}

/// Loads `model` with `options` and packs it for `kernels`, which must support its precision.
pub fn load(
    model: &ModelSource,
    options: &Options,
    kernels: &'static Kernels,
) -> Result<Loaded, Error> {
    let (mut file, mut card) = model.open()?;
    if card.asked.is_some() {
        let cause = "expected a model of clouds, found a bird's-eye model, which `detect` takes";
        return Err(FormatError::malformed(model.name(), "card", cause).into());
    }
    if let Some(ranges) = &options.activation_ranges {
        card.activation_ranges.clone_from(ranges);
    }
    if options.precision == Precision::I8 && card.activation_ranges.is_empty() {
        card.activation_ranges = calibrate::on_shapes_of(model)?;
    }
    match options.precision {
        Precision::F32 => loaded::<F32>(&mut file, card, options, kernels),
        Precision::I8 => loaded::<I8>(&mut file, card, options, kernels),
    }
}

fn loaded<T: Format>(
    file: &mut WeightsFile,
    card: ModelCard,
    &Options { threads, .. }: &Options,
    kernels: &'static Kernels,
) -> Result<Loaded, Error> {
    let layers = layers::pack::<T>(file, &card, kernels)?;
    let parts = layers.parts();
    let engine = Engine::new(Arc::new(layers), kernels, threads, false);
    let team = Team::new(engine, threads).map_err(|source| Error::Threads { threads, source })?;
    Ok(Loaded { card, network: Box::new(team), parts })
}
