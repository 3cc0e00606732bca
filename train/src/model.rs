//! A network with its optional Critical Points Layer.

use crate::batch::Batch;
use crate::layer::{LayerMut, Module};
use crate::loss::Loss;
use crate::matrix::Matrix;
use crate::network::PointNet;
use crate::point_encoder::PointEncoder;

/// A network with its optional point encoder.
#[derive(Clone, Debug)]
pub struct Model {
    /// Selects the points for the network.
    pub encoder: Option<PointEncoder>,
    /// Classifies the selected points.
    pub network: PointNet,
}

impl Model {
    /// Runs the forward and backward pass of a batch, which sets the gradients of the parameters.
    /// `kept` is the dropout mask; `momentum` is the share of the batch in the running
    /// statistics.
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, momentum: f32) -> Loss {
        let Some(encoder) = &mut self.encoder else {
            return self.network.learn(batch, kept, momentum);
        };
        let selected = encoder.forward(batch, momentum);
        let mut loss = self.network.learn(&selected, kept, momentum);
        loss.total += encoder.backward(batch);
        loss
    }
}

impl Module for Model {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        let encoder = self.encoder.iter_mut().flat_map(Module::layers);
        encoder.chain(self.network.layers()).collect()
    }
}
