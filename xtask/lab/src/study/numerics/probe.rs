//! Model files that end early: the pooled outputs of a layer become logits through an identity,
//! computed by `infer-cpu` itself.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use formats::model_card::{ModelCard, Normalization};
use formats::weights::{Tensor, write_weights};

use crate::measure::reference_network::{Chain, Network};

/// Writes the model of the first `n_layers` of `chain`.
pub fn write(network: &Network, chain: &Chain, n_layers: usize, path: &Path) -> Result<()> {
    let n_convs = n_layers.min(chain.convs.len());
    let n_fcs = n_layers - n_convs;
    let mut model = Model { network, tensors: BTreeMap::new(), ranges: BTreeMap::new() };
    for (i, name) in chain.convs[..n_convs].iter().enumerate() {
        model.copy(name, &format!("feat.conv{}", i + 1));
    }
    let mut width = model.width(&chain.convs[n_convs - 1]);
    if n_convs == 1 {
        model.identity("feat.conv2", width);
    }
    for (i, name) in chain.fcs[..n_fcs].iter().enumerate() {
        model.copy(name, &format!("fc{}", i + 1));
        width = model.width(name);
    }
    if n_fcs == 0 {
        model.identity("fc1", width);
    }
    if chain.stn {
        model.copy_all("feat.stn.");
    }
    let transformed = chain.fstn_after.filter(|&after| after < n_convs);
    if transformed.is_some() {
        model.copy_all("feat.fstn.");
    }
    if chain.edges {
        model.copy_all("edge.");
    }
    let whole = n_convs == chain.convs.len();
    let card = ModelCard {
        normalization: Normalization::UnitSphere,
        transform_after: transformed.unwrap_or(1),
        pooled_relu: !whole || chain.pooled_relu,
        edge_radii: if chain.edges { network.card.edge_radii.clone() } else { Vec::new() },
        activation_ranges: model.ranges,
        provenance: Some("a part of a network, to be measured".to_owned()),
        ..ModelCard::default()
    };
    Ok(write_weights(path, &model.tensors, &card.to_metadata())?)
}

struct Model<'a> {
    network: &'a Network,
    tensors: BTreeMap<String, Tensor>,
    ranges: BTreeMap<String, f32>,
}

impl Model<'_> {
    fn copy(&mut self, from: &str, to: &str) {
        for part in ["weight", "bias"] {
            let mut tensor = self.network.tensors[&format!("{from}.{part}")].clone();
            // A vector layer of a T-Network and a point-wise one differ by an axis of 1.
            tensor.shape.truncate(2);
            self.tensors.insert(format!("{to}.{part}"), tensor);
        }
        self.ranges.insert(to.to_owned(), self.network.range(from) as f32);
    }

    /// Copies every layer whose name begins with `prefix`.
    fn copy_all(&mut self, prefix: &str) {
        let named = |name: &&String| name.starts_with(prefix);
        for name in self.network.tensors.keys().filter(named) {
            self.tensors.insert(name.clone(), self.network.tensors[name].clone());
            if let Some(layer) = name.strip_suffix(".weight") {
                self.ranges.insert(layer.to_owned(), self.network.range(layer) as f32);
            }
        }
    }

    fn identity(&mut self, to: &str, width: usize) {
        let mut values = vec![0.0; width * width];
        (0..width).for_each(|i| values[i * width + i] = 1.0);
        let weight = Tensor { shape: vec![width, width], values };
        self.tensors.insert(format!("{to}.weight"), weight);
        let bias = Tensor { shape: vec![width], values: vec![0.0; width] };
        self.tensors.insert(format!("{to}.bias"), bias);
    }

    fn width(&self, name: &str) -> usize {
        self.network.tensors[&format!("{name}.bias")].values.len()
    }
}
