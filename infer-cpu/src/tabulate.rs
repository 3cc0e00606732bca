//! Front ends turned into look-up tables: what LUTI-MLP trains (Sekikawa and
//! Suzuki, arXiv 1912.00790), taken from layers that were trained as such.

use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile, tensor_part};

use crate::dense::Dense;
use crate::engine::Pass;
use crate::error::Error;
use crate::network::{Front, Network, TABLE, read_network};
use crate::sampler::Lattice;

/// Tabulates the layers of `pass` of the model at `path` on a lattice of
/// `nodes` nodes an axis, over the cube that holds the unit sphere.
///
/// # Errors
/// A file that is no model; fewer than 2 nodes, or so many that the table
/// cannot be held.
pub fn front_end(path: &Path, pass: Pass, nodes: usize) -> Result<Lattice, Error> {
    let mut file = WeightsFile::open(path)?;
    let card = ModelCard::from_metadata(path, &file.metadata())?;
    let network = read_network(&mut file, &card, |dense, _| dense, |_| ())?;
    let bad = |cause| FormatError::malformed(path, tensor_part(TABLE), cause);
    let layers = match layers_of(network, pass) {
        Ok(layers) => layers,
        Err(Tensor { shape, values }) => {
            return Ok(Lattice::new(shape[0], shape[3], &values).map_err(bad)?);
        }
    };
    let channels = layers.last().map_or(0, |layer| layer.outputs);
    let mut features = Features::default();
    let table = Lattice::tabulate(nodes, channels, |points, out| {
        for (point, out) in points.iter().zip(out.chunks_exact_mut(channels)) {
            out.copy_from_slice(features.of(point, &layers));
        }
    });
    Ok(table.map_err(bad)?)
}

/// The layers of `pass`, or the table that stands for them already.
fn layers_of(network: Network<Dense, ()>, pass: Pass) -> Result<Vec<Dense>, Tensor> {
    match (pass, network.front, network.stn) {
        (Pass::Front, Some(Front::Mlp(layers)), _) => Ok(layers),
        (Pass::Front, Some(Front::Table(table)), _) => Err(table),
        (Pass::Stn, _, Some(stn)) => Ok(stn.convs),
        _ => Ok(network.trunk),
    }
}

/// A point's features, layer by layer in f32.
#[derive(Default)]
struct Features {
    values: Vec<f32>,
    next: Vec<f32>,
}

impl Features {
    fn of(&mut self, point: &[f32; 3], layers: &[Dense]) -> &[f32] {
        self.values.clear();
        self.values.extend(point);
        for layer in layers {
            self.next.clear();
            self.next.extend((0..layer.outputs).map(|output| {
                let weights = &layer.weight[output * layer.inputs..][..layer.inputs];
                let products = weights.iter().zip(&self.values).map(|(w, x)| w * x);
                let sum = layer.bias[output] + products.sum::<f32>();
                if layer.relu { sum.max(0.0) } else { sum }
            }));
            std::mem::swap(&mut self.values, &mut self.next);
        }
        &self.values
    }
}
