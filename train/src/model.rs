//! A network, perhaps behind a Critical Points Layer.

use crate::batch::Batch;
use crate::layer::{Folded, Module};
use crate::loss::Loss;
use crate::matrix::Matrix;
use crate::network::{PointNet, Rates};
use crate::parameter::Parameter;
use crate::point_encoder::PointEncoder;

/// A network, perhaps behind a point encoder.
#[derive(Clone, Debug)]
pub struct Model {
    /// What chooses points.
    pub encoder: Option<PointEncoder>,
    /// What classifies them.
    pub network: PointNet,
}

impl Model {
    /// Takes a batch forward and backward: gradients are left in the
    /// parameters.
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, rates: Rates) -> Loss {
        let Some(encoder) = &mut self.encoder else {
            return self.network.learn(batch, kept, rates);
        };
        let selection = encoder.forward(batch, rates);
        let wanted = encoder.is_relaxed();
        let (mut loss, dpoints) = self.network.learn_points(&selection.batch, kept, rates, wanted);
        loss.total += encoder.backward(batch, &selection, dpoints.as_ref());
        loss
    }

    /// The first layer whose last output was not finite.
    #[must_use]
    pub fn not_finite(&self) -> &str {
        let encoder = self.encoder.as_ref().and_then(PointEncoder::not_finite);
        encoder.unwrap_or_else(|| self.network.not_finite())
    }
}

impl Module for Model {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        if let Some(encoder) = &mut self.encoder {
            encoder.parameters(visit);
        }
        self.network.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        if let Some(encoder) = &mut self.encoder {
            encoder.statistics(visit);
        }
        self.network.statistics(visit);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        if let Some(encoder) = &self.encoder {
            encoder.folded(visit);
        }
        self.network.folded(visit);
    }
}
