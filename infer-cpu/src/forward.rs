//! A network of whichever precision, loaded and ready to run.

use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{WeightsFile, tensor_part};

use crate::calibrate;
use crate::engine::{Engine, Memory, Met, Pass};
use crate::error::Error;
use crate::kernel::Kernels;
use crate::layers;
use crate::precision::{F16, F32, F32Fc16, Format, I8, Precision};
use crate::team::Team;

/// A network behind whichever format.
pub trait Forward: Send + Sync {
    /// Makes room for clouds of `n` points.
    fn reserve(&self, n: usize);
    /// Takes the points of the passes that follow.
    fn set_points(&self, points: &[[f32; 3]]);
    /// Pools the points of `pass` into `memory`.
    fn pool(&self, pass: Pass, memory: &mut Memory);
    /// Leaves the logits in `memory.values`; see [`Engine::classify`].
    fn classify(&self, memory: &mut Memory, pooled_stn: bool);
    /// What happened since the points were set.
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

    fn pool(&self, pass: Pass, memory: &mut Memory) {
        Engine::pool(self, pass, memory);
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
        self.work().layers().head.last().map_or(0, |layer| layer.columns.outputs)
    }
}

/// Loads the model at `path` and packs it for `precision` and `kernels`.
///
/// # Errors
/// A file that is no model; threads that cannot be started.
pub fn load(
    path: &Path,
    precision: Precision,
    kernels: &'static Kernels,
    threads: usize,
) -> Result<(ModelCard, Box<dyn Forward>), Error> {
    let mut file = WeightsFile::open(path)?;
    let mut card = ModelCard::from_metadata(path, &file.metadata())?;
    if precision == Precision::I8 && card.activation_ranges.is_empty() {
        card.activation_ranges = calibrate::on_shapes(path)?;
    }
    let network: Box<dyn Forward> = match precision {
        Precision::F32 => Box::new(team::<F32>(&mut file, &card, kernels, threads)?),
        Precision::F32Fc16 => Box::new(team::<F32Fc16>(&mut file, &card, kernels, threads)?),
        Precision::F16 => Box::new(team::<F16>(&mut file, &card, kernels, threads)?),
        Precision::I8 => Box::new(team::<I8>(&mut file, &card, kernels, threads)?),
    };
    let (n_names, n_classes) = (card.classes.len(), network.n_classes());
    if n_names != 0 && n_names != n_classes {
        let cause = format!("{n_classes} logits, but `classes` names {n_names}");
        return Err(FormatError::malformed(path, tensor_part("last layer"), cause).into());
    }
    Ok((card, network))
}

fn team<T: Format>(
    file: &mut WeightsFile,
    card: &ModelCard,
    kernels: &'static Kernels,
    threads: usize,
) -> Result<Team<Engine<T>>, Error> {
    let layers = layers::pack::<T>(file, card, kernels)?;
    let engine = Engine::new(layers, kernels, threads, false);
    Team::new(engine, threads).map_err(|source| Error::Threads { threads, source })
}
