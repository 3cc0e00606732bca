//! A network with its optional Critical Points Layer.

use crate::batch::Batch;
use crate::layer::{LayerMut, Module};
use crate::loss::Loss;
use crate::matrix::Matrix;
use crate::network::{PointNet, Rates};
use crate::point_encoder::PointEncoder;
use crate::set_network::SetNetwork;

/// A network with its optional point encoder.
#[derive(Clone, Debug)]
pub struct Model {
    /// Selects the points for the network.
    pub encoder: Option<PointEncoder>,
    /// Classifies the selected points.
    pub network: Network,
}

/// A network of either kind.
#[derive(Clone, Debug)]
pub enum Network {
    /// One pooling over the whole cloud.
    PointNet(Box<PointNet>),
    /// Set abstractions.
    Sets(Box<SetNetwork>),
}

impl Network {
    /// The width of the dropout mask. `None` if there is no hidden layer after the last pooling.
    #[must_use]
    pub fn dropout_width(&self) -> Option<usize> {
        match self {
            Self::PointNet(network) => network.dropout_width(),
            Self::Sets(network) => network.dropout_width(),
        }
    }
}

impl Model {
    /// Runs the forward and backward pass of a batch, which sets the gradients of the parameters.
    /// `kept` is the dropout mask.
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, rates: Rates) -> Loss {
        let network = match &mut self.network {
            Network::PointNet(network) => network,
            // A recipe has no Critical Points Layer before set abstractions.
            Network::Sets(network) => return network.learn(batch, kept, rates),
        };
        let Some(encoder) = &mut self.encoder else {
            return network.learn(batch, kept, rates);
        };
        let selected = encoder.forward(batch, rates.momentum);
        let mut loss = network.learn(&selected, kept, rates);
        loss.total += encoder.backward(batch);
        loss
    }
}

impl Module for Model {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        let encoder = self.encoder.iter_mut().flat_map(Module::layers);
        let network = match &mut self.network {
            Network::PointNet(network) => network.layers(),
            Network::Sets(network) => network.layers(),
        };
        encoder.chain(network).collect()
    }
}
