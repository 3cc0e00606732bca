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

use std::path::Path;

use edgepuck_kernels::{F32, Format, I8, Kernels};
use edgepuck_segment::Label;

use crate::classify::classifier::choose_kernels;
use crate::engine::team::Team;
use crate::error::Error;
use crate::model::source::ModelSource;
use crate::precision::Precision;
use heights::Heights;
use image::Image;
use layers::Layers;
use network::{Forward, Network};
pub use peaks::Seen;

/// A loaded network.
pub struct BirdsEye {
    network: Box<dyn Forward>,
    /// The names of the classes.
    pub classes: Vec<String>,
}

impl BirdsEye {
    /// Loads the bundled model of this name, or the model file at `path`.
    ///
    /// # Errors
    /// A file that cannot be read or is no such model; threads that cannot be started; a machine
    /// without kernels for `precision`.
    pub fn load(path: &Path, precision: Precision, threads: usize) -> Result<Self, Error> {
        let (mut file, card) = ModelSource::of(path)?.open()?;
        let kernels = choose_kernels(precision, None)?;
        let network = match precision {
            Precision::F32 => {
                team::<F32>(Layers::read(&mut file, &card, kernels)?, kernels, threads)
            }
            Precision::I8 => team::<I8>(Layers::read(&mut file, &card, kernels)?, kernels, threads),
        };
        let network = network.map_err(|source| Error::Threads { threads, source })?;
        Ok(Self { network, classes: card.classes })
    }

    /// The objects among `points`, metres in the sensor's frame, whose score is `least` or more: the
    /// best first. `labels` tell the ground from what stands on it.
    #[must_use]
    pub fn objects(&self, points: &[[f32; 3]], labels: &[Label], least: f32) -> Vec<Seen> {
        let ground = Heights::of(points, labels);
        let image = ground.map(|ground| Image::new(points, labels, &ground));
        image.map_or_else(Vec::new, |image| peaks::objects(&*self.network, image, least))
    }
}

fn team<T: Format>(
    layers: Layers<T>,
    kernels: &'static Kernels,
    threads: usize,
) -> std::io::Result<Box<dyn Forward>> {
    Ok(Box::new(Team::new(Network::new(layers, kernels, threads), threads)?))
}
