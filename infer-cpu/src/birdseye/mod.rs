//! A network that sees a whole sweep from above: where cars, persons, two-wheelers and trucks are, and
//! their boxes.
//!
//! What it takes and gives is described in `image` and `peaks`; `plan` is the network.
//! `python/training/birdseye` trains it.

mod heights;
mod image;
mod layers;
mod network;
mod peaks;
mod plan;
mod standing;
#[cfg(test)]
pub mod testing;
#[cfg(test)]
mod tests;

use edgepuck_kernels::{F32, Format, I8, Kernels};
use edgepuck_segment::Label;
use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::WeightsFile;

use crate::classify::classifier::choose_kernels;
use crate::classify::options::Options;
use crate::engine::team::Team;
use crate::error::Error;
use crate::precision::Precision;
pub use heights::Heights;
use image::Image;
use layers::Layers;
use network::{Forward, Network};
pub use peaks::{Scores, Seen};
use plan::CLASSES;
pub use plan::PERSON;
pub use standing::Standing;

/// A loaded network.
pub struct BirdsEye {
    pub(crate) network: Box<dyn Forward>,
}

impl BirdsEye {
    /// The network in `file`, whose card is `card`, with the precision and the threads of `options`.
    ///
    /// # Errors
    /// A file that is no such model; threads that cannot be started; a machine without kernels for the
    /// precision.
    pub fn new(file: &mut WeightsFile, card: &ModelCard, options: &Options) -> Result<Self, Error> {
        if card.classes != CLASSES {
            let cause = format!("expected {CLASSES:?}, found {:?}", card.classes);
            return Err(FormatError::malformed(file.path(), "metadata `classes`", cause).into());
        }
        let kernels = choose_kernels(options.precision, options.kernel)?;
        let network = match options.precision {
            Precision::F32 => team(Layers::<F32>::read(file, card, kernels)?, kernels, options),
            Precision::I8 => team(Layers::<I8>::read(file, card, kernels)?, kernels, options),
        };
        Ok(Self { network: network? })
    }

    /// What the network sees of `points`, metres in the sensor's frame. `labels` tell the ground from what
    /// stands on it.
    #[must_use]
    pub fn look(&self, points: &[[f32; 3]], labels: &[Label], ground: &Heights) -> Scores {
        Scores::new(&*self.network, Image::new(points, labels, ground))
    }
}

fn team<T: Format>(
    layers: Layers<T>,
    kernels: &'static Kernels,
    options: &Options,
) -> Result<Box<dyn Forward>, Error> {
    let threads = options.threads;
    let network = Team::new(Network::new(layers, kernels, threads), threads);
    Ok(Box::new(network.map_err(|source| Error::Threads { threads, source })?))
}
