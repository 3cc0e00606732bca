//! The layers of a model file, and a stand-in for a trained model: the baseline network
//! with random weights.

use crate::measure::baseline::{STACKS, drawn};
use anyhow::{Context, Result};
use formats::model_card::{ModelCard, Normalization};
use formats::rng::StreamKey;
use formats::weights::{Tensor, write_weights};
use infer_cpu::{LayerShape, NetShape, inspect};
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layer {
    pub inputs: usize,
    pub outputs: usize,
}

/// Layers before and after a pooling.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Net {
    /// Point-wise layers.
    pub convs: Vec<Layer>,
    /// Vector layers.
    pub fcs: Vec<Layer>,
}

/// The layers after a set abstraction's pooling.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Abstraction {
    pub centres: usize,
    pub convs: Vec<Layer>,
}

/// The layers of a network; missing parts are empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    pub stn: Net,
    pub fstn: Net,
    pub trunk: Net,
    /// Layers of the trunk before the feature transform.
    pub transform_after: usize,
    /// The set abstractions after the trunk.
    pub abstractions: Vec<Abstraction>,
    /// The front end of a Critical Points Layer.
    pub front: Net,
}

impl Network {
    pub fn read(path: &Path) -> Result<Self> {
        let model = inspect(path)?;
        let abstraction = |(centres, layers): (usize, Vec<LayerShape>)| {
            // The first layer pools.
            Abstraction { centres, convs: layers.into_iter().skip(1).map(layer).collect() }
        };
        let front = NetShape { convs: model.front.unwrap_or_default(), fcs: Vec::new() };
        Ok(Self {
            stn: model.stn.map(net).unwrap_or_default(),
            fstn: model.fstn.map(net).unwrap_or_default(),
            trunk: net(model.trunk),
            transform_after: model.card.transform_after,
            abstractions: model.abstractions.into_iter().map(abstraction).collect(),
            front: net(front),
        })
    }
}

fn layer(LayerShape { inputs, outputs, .. }: LayerShape) -> Layer {
    Layer { inputs, outputs }
}

fn net(NetShape { convs, fcs }: NetShape) -> Net {
    let [convs, fcs] = [convs, fcs].map(|layers| layers.into_iter().map(layer).collect());
    Net { convs, fcs }
}

/// Writes a stand-in to `path`, calibrated for int8.
pub fn write_stand_in(path: &Path) -> Result<()> {
    let mut tensors = BTreeMap::new();
    for (stack, widths) in STACKS {
        for (i, pair) in (1..).zip(widths.windows(2)) {
            let (inputs, outputs) = (pair[0], pair[1]);
            let mut bias = Tensor { shape: vec![outputs], values: vec![0.0; outputs] };
            // Uniform with the variance that keeps activations' (He et al. 2015).
            let mut bound = (6.0 / inputs as f64).sqrt();
            if stack.ends_with("stn.fc") && i + 1 == widths.len() {
                // T-Nets predict nearly the identity, so that nothing overflows.
                bound *= 0.01;
                let diagonal = bias.values.iter_mut().step_by(outputs.isqrt() + 1);
                diagonal.for_each(|value| *value += 1.0);
            }
            let key = StreamKey::new(0, &format!("{stack}{i}"), 0);
            let weight = drawn(key, &[outputs, inputs], |unit| bound * (2.0 * unit - 1.0));
            tensors.insert(format!("{stack}{i}.weight"), weight);
            tensors.insert(format!("{stack}{i}.bias"), bias);
        }
    }
    let mut card = ModelCard {
        normalization: Normalization::UnitSphere,
        trained: false,
        ..ModelCard::from_metadata(path, &BTreeMap::new())?
    };
    write_weights(path, &tensors, &card.to_metadata())?;
    card.activation_ranges =
        infer_cpu::activation_ranges_by_rule(path).context("calibrating the stand-in for int8")?;
    Ok(write_weights(path, &tensors, &card.to_metadata())?)
}

#[cfg(test)]
pub mod tests {
    use super::*;

    pub fn baseline() -> Network {
        let layer = |pair: &[usize]| Layer { inputs: pair[0], outputs: pair[1] };
        let [stn, stn_fcs, fstn, fstn_fcs, trunk, head, front] =
            STACKS.map(|(_, widths)| widths.windows(2).map(layer).collect());
        Network {
            stn: Net { convs: stn, fcs: stn_fcs },
            fstn: Net { convs: fstn, fcs: fstn_fcs },
            trunk: Net { convs: trunk, fcs: head },
            transform_after: 1,
            abstractions: Vec::new(),
            front: Net { convs: front, fcs: Vec::new() },
        }
    }

    #[test]
    fn the_stand_in_is_the_baseline() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stand-in.safetensors");
        write_stand_in(&path).unwrap();
        assert_eq!(Network::read(&path).unwrap(), baseline());
        let classifier = infer_cpu::Classifier::load(&path, &infer_cpu::Options::default());
        assert_eq!(classifier.unwrap().classes().len(), 40);
    }
}
