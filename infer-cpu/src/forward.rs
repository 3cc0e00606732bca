//! A network of whichever precision, loaded and ready to run.

use std::collections::BTreeMap;

use formats::model_card::ModelCard;
use formats::weights::WeightsFile;

use crate::calibrate;
use crate::engine::{Engine, Input, Pass, Scratch};
use crate::error::Error;
use crate::kernel::Kernels;
use crate::layers;
use crate::network::Parts;
use crate::options::TNets;
use crate::precision::{F16, F32, F32Fc16, Format, I8, Precision};
use crate::source::ModelSource;
use crate::team::Team;

/// A network behind whichever format.
///
/// A run takes all it needs by its arguments: no call depends on those before.
pub trait Forward: Send + Sync {
    /// Makes room for clouds of `n` points.
    fn reserve(&self, n: usize);
    /// Takes `input` through the whole network; the logits are left in
    /// `scratch.values`, and what left the format's range is added to
    /// `scratch.events`.
    fn run(&self, input: &Input<'_>, scratch: &mut Scratch);
    /// Pools the features of `pass` into `scratch.values`, with the points
    /// that won in `scratch.winners`.
    fn pool_winners(&self, pass: Pass, input: &Input<'_>, scratch: &mut Scratch);
    /// How many features `pass` pools.
    fn channels(&self, pass: Pass) -> usize;
    /// Memory that no run outgrows.
    fn scratch(&self) -> Scratch;
    /// How many classes the network tells apart.
    fn n_classes(&self) -> usize;
}

impl<T: Format> Forward for Team<Engine<T>> {
    fn reserve(&self, n: usize) {
        self.work().reserve(n);
    }

    fn run(&self, input: &Input<'_>, scratch: &mut Scratch) {
        Engine::run(self, input, scratch);
    }

    fn pool_winners(&self, pass: Pass, input: &Input<'_>, scratch: &mut Scratch) {
        Engine::pool_winners(self, pass, input, scratch);
    }

    fn channels(&self, pass: Pass) -> usize {
        self.work().channels(pass)
    }

    fn scratch(&self) -> Scratch {
        self.work().scratch()
    }

    fn n_classes(&self) -> usize {
        self.work().layers().head.last().map_or(0, |layer| layer.columns.outputs())
    }
}

/// A model, packed and ready.
pub struct Loaded {
    /// What it says about itself.
    pub card: ModelCard,
    /// Its network.
    pub network: Box<dyn Forward>,
    /// What the network consists of.
    pub parts: Parts,
}

/// What to load a network for.
#[derive(Clone, Copy)]
pub struct Setup<'a> {
    /// What to compute in.
    pub precision: Precision,
    /// The kernels, which have that precision's products.
    pub kernels: &'static Kernels,
    /// Threads, the caller's among them.
    pub threads: usize,
    /// The T-Nets to run.
    pub t_nets: TNets,
    /// The largest activation of each layer, in place of the model's own.
    pub activation_ranges: Option<&'a BTreeMap<String, f32>>,
}

/// Loads `model` and packs it.
///
/// # Errors
/// A source that is not a model; threads that cannot be started.
pub fn load(model: &ModelSource, setup: &Setup<'_>) -> Result<Loaded, Error> {
    let (mut file, mut card) = model.open()?;
    if let Some(ranges) = setup.activation_ranges {
        card.activation_ranges.clone_from(ranges);
    }
    if setup.precision == Precision::I8 && card.activation_ranges.is_empty() {
        card.activation_ranges = calibrate::on_shapes_of(model)?;
    }
    match setup.precision {
        Precision::F32 => loaded::<F32>(&mut file, card, setup),
        Precision::F32Fc16 => loaded::<F32Fc16>(&mut file, card, setup),
        Precision::F16 => loaded::<F16>(&mut file, card, setup),
        Precision::I8 => loaded::<I8>(&mut file, card, setup),
    }
}

fn loaded<T: Format>(
    file: &mut WeightsFile,
    card: ModelCard,
    setup: &Setup<'_>,
) -> Result<Loaded, Error> {
    let Setup { kernels, threads, t_nets, .. } = *setup;
    let mut layers = layers::pack::<T>(file, &card, kernels)?;
    layers.stn.take_if(|_| !t_nets.runs_input());
    layers.fstn.take_if(|_| !t_nets.runs_feature());
    let parts = layers.parts();
    let engine = Engine::new(layers, kernels, threads, false);
    let team = Team::new(engine, threads).map_err(|source| Error::Threads { threads, source })?;
    Ok(Loaded { card, network: Box::new(team), parts })
}
