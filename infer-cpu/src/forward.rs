//! A network of whichever precision, loaded and ready to run.

use std::collections::BTreeMap;
use std::path::Path;

use formats::model_card::ModelCard;
use formats::weights::WeightsFile;

use crate::calibrate;
use crate::engine::{Engine, Memory, Met, Pass};
use crate::error::Error;
use crate::kernel::Kernels;
use crate::layers;
use crate::options::TNets;
use crate::precision::{F16, F32, F32Fc16, Format, I8, Precision};
use crate::selection::Parts;
use crate::team::Team;

/// A network behind whichever format.
pub trait Forward: Send + Sync {
    /// Makes room for clouds of `n` points.
    fn reserve(&self, n: usize);
    /// Takes the points of the passes that follow.
    fn set_points(&self, points: &[[f32; 3]]);
    /// Takes `cloud` for what surrounds those points, where the network looks
    /// at it.
    fn set_surroundings(&self, cloud: &[[f32; 3]]);
    /// Forgets what earlier passes met.
    fn reset(&self);
    /// Pools the points of `pass` into `memory`, with the points that won.
    fn pool_winners(&self, pass: Pass, memory: &mut Memory);
    /// How many features `pass` pools.
    fn channels(&self, pass: Pass) -> usize;
    /// Leaves the logits in `memory.values`; see [`Engine::classify`].
    fn classify(&self, memory: &mut Memory, pooled_stn: bool);
    /// What passes met since [`Forward::reset`].
    fn met(&self) -> Met;
    /// Memory that no pass outgrows.
    fn memory(&self) -> Memory;
    /// How many classes the network tells apart.
    fn n_classes(&self) -> usize;
}

impl<T: Format> Forward for Team<Engine<T>> {
    fn reserve(&self, n: usize) {
        self.work().reserve(n);
    }

    fn set_points(&self, points: &[[f32; 3]]) {
        self.work().set_points(points);
    }

    fn set_surroundings(&self, cloud: &[[f32; 3]]) {
        self.work().set_surroundings(cloud);
    }

    fn reset(&self) {
        self.work().reset();
    }

    fn pool_winners(&self, pass: Pass, memory: &mut Memory) {
        Engine::pool(self, pass, true, memory);
    }

    fn channels(&self, pass: Pass) -> usize {
        self.work().channels(pass)
    }

    fn classify(&self, memory: &mut Memory, pooled_stn: bool) {
        Engine::classify(self, memory, pooled_stn);
    }

    fn met(&self) -> Met {
        self.work().met()
    }

    fn memory(&self) -> Memory {
        self.work().memory()
    }

    fn n_classes(&self) -> usize {
        self.work().layers().head.last().map_or(0, |layer| layer.columns.outputs())
    }
}

/// A model file, packed and ready.
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

/// Loads the model at `path` and packs it.
///
/// # Errors
/// A file that is no model; threads that cannot be started.
pub fn load(path: &Path, setup: &Setup<'_>) -> Result<Loaded, Error> {
    let mut file = WeightsFile::open(path)?;
    let mut card = ModelCard::from_metadata(path, &file.metadata())?;
    if let Some(ranges) = setup.activation_ranges {
        card.activation_ranges.clone_from(ranges);
    }
    if setup.precision == Precision::I8 && card.activation_ranges.is_empty() {
        card.activation_ranges = calibrate::on_shapes(path)?;
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
    let parts = Parts {
        stn: layers.stn.is_some(),
        fstn: layers.fstn.is_some(),
        front: layers.front.is_some(),
    };
    let engine = Engine::new(layers, kernels, threads, false);
    let team = Team::new(engine, threads).map_err(|source| Error::Threads { threads, source })?;
    Ok(Loaded { card, network: Box::new(team), parts })
}
