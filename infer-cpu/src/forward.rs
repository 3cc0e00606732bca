//! Loads a network in any precision.

use std::sync::Arc;

use formats::model_card::ModelCard;
use formats::weights::WeightsFile;

use crate::calibrate;
use crate::engine::{Engine, Forward};
use crate::error::Error;
use crate::kernel::Kernels;
use crate::layers;
use crate::network::Parts;
use crate::options::Options;
use crate::precision::{F16, F32, F32Fc16, Format, I8, Precision};
use crate::source::ModelSource;
use crate::team::Team;

pub struct Loaded {
    pub card: ModelCard,
    pub network: Box<dyn Forward>,
    /// The optional parts that it has.
    pub parts: Parts,
}

/// Loads `model` with `options` and packs it for `kernels`, which must support `precision`.
pub fn load(
    model: &ModelSource,
    options: &Options,
    precision: Precision,
    kernels: &'static Kernels,
) -> Result<Loaded, Error> {
    let (mut file, mut card) = model.open()?;
    if let Some(ranges) = &options.activation_ranges {
        card.activation_ranges.clone_from(ranges);
    }
    if precision == Precision::I8 && card.activation_ranges.is_empty() {
        card.activation_ranges = calibrate::on_shapes_of(model)?;
    }
    match precision {
        Precision::F32 => loaded::<F32>(&mut file, card, options, kernels),
        Precision::F32Fc16 => loaded::<F32Fc16>(&mut file, card, options, kernels),
        Precision::F16 => loaded::<F16>(&mut file, card, options, kernels),
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
