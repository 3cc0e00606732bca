//! PointNet in f64 by plain loops: the reference of every measured error.
//!
//! [`affine`] maps rows of values and carries the bound of what a computation in a
//! lower precision may lose; [`forward`] runs points through the layers.

pub mod affine;
mod forward;

pub use forward::{Points, outputs};

use affine::{Affine, Rows};
use anyhow::{Context, Result, ensure};
use formats::model_card::ModelCard;
use formats::rng::StreamKey;
use formats::weights::{Tensor, WeightsFile};
use infer_cpu::Precision;
use std::collections::BTreeMap;
use std::path::Path;

/// The stacks of `pointnet_cls` of yanx27/Pointnet_Pointnet2_pytorch for 40 classes: what
/// the names of their layers begin with, and their widths. The last is the front end of a
/// Critical Points Layer, as wide as the trunk.
pub const STACKS: [(&str, &[usize]); 7] = [
    ("feat.stn.conv", &[3, 64, 128, 1024]),
    ("feat.stn.fc", &[1024, 512, 256, 9]),
    ("feat.fstn.conv", &[64, 64, 128, 1024]),
    ("feat.fstn.fc", &[1024, 512, 256, 64 * 64]),
    ("feat.conv", &[3, 64, 128, 1024]),
    ("fc", &[1024, 512, 256, 40]),
    ("cpl.conv", &[3, 64, 128, 1024]),
];

/// A tensor of random numbers: `number` of each of the numbers of `key` in [0, 1).
pub fn drawn(key: StreamKey, shape: &[usize], number: impl Fn(f64) -> f64) -> Tensor {
    let count = shape.iter().product::<usize>() as u64;
    let values = (0..count).map(|i| number(key.unit(i)) as f32).collect();
    Tensor { shape: shape.to_vec(), values }
}

/// PyTorch's default.
const BN_EPSILON: f64 = 1e-5;

pub struct Network {
    pub card: ModelCard,
    pub tensors: BTreeMap<String, Tensor>,
}

/// Layers that points go through one after the other, a pooling, and layers that
/// the pooled vector goes through: the trunk and head, or those of a T-Net.
#[derive(Clone, Default)]
pub struct Chain {
    /// Names of point-wise layers.
    pub convs: Vec<String>,
    /// Names of vector layers.
    pub fcs: Vec<String>,
    /// Whether the last point-wise layer has a ReLU.
    pub pooled_relu: bool,
    /// Whether the input T-Net transforms the coordinates first.
    pub stn: bool,
    /// The number of layers after which the T-Net of features transforms them.
    pub fstn_after: Option<usize>,
    /// Whether points carry EdgeConv features.
    pub edges: bool,
}

impl Network {
    pub fn read(path: &Path) -> Result<Self> {
        let mut file = WeightsFile::open(path)?;
        let card = ModelCard::from_metadata(path, &file.metadata())?;
        let mut tensors = BTreeMap::new();
        // PyTorch counts batches in integers, which inference does not need.
        let is_needed = |name: &String| !name.ends_with(".num_batches_tracked");
        for name in file.shapes().into_keys().filter(is_needed) {
            tensors.insert(name.clone(), file.read(&name)?);
        }
        Ok(Self { card, tensors })
    }

    fn layers(&self, stem: &str) -> Vec<String> {
        let name = |i: usize| format!("{stem}{i}");
        let is_there = |name: &String| self.tensors.contains_key(&format!("{name}.weight"));
        (1..).map(name).take_while(is_there).collect()
    }

    /// Every chain of the network: T-Nets first.
    pub fn chains(&self) -> Vec<Chain> {
        let after = self.card.transform_after;
        let [stn, fstn] = ["feat.stn.", "feat.fstn."].map(|t| self.layers(&format!("{t}conv")));
        let (has_stn, has_fstn) = (!stn.is_empty(), !fstn.is_empty());
        let trunk = self.layers("feat.conv");
        let edges = !self.card.edge_radii.is_empty();
        let mut chains = Vec::new();
        if has_stn {
            let fcs = self.layers("feat.stn.fc");
            chains.push(Chain { convs: stn, fcs, pooled_relu: true, ..Chain::default() });
        }
        if has_fstn {
            let convs = trunk[..after].iter().cloned().chain(fstn).collect();
            let fcs = self.layers("feat.fstn.fc");
            let own = Chain { convs, fcs, pooled_relu: true, ..Chain::default() };
            chains.push(Chain { stn: has_stn, edges, ..own });
        }
        chains.push(Chain {
            convs: trunk,
            fcs: self.layers("fc"),
            pooled_relu: self.card.pooled_relu,
            stn: has_stn,
            fstn_after: has_fstn.then_some(after),
            edges,
        });
        chains
    }

    /// The layer `name`, its batch norm folded in; `relu` says whether it ends in a ReLU.
    pub fn affine(&self, name: &str, relu: bool) -> Result<Affine> {
        let mut b = self.values(&format!("{name}.bias"))?;
        let mut w = self.values(&format!("{name}.weight"))?;
        let (outputs, inputs) = (b.len(), w.len() / b.len().max(1));
        ensure!(outputs * inputs == w.len(), "{name}: {} weights, {outputs} biases", w.len());
        let norm = self.norm_of(name);
        if self.tensors.contains_key(&format!("{norm}.running_var")) {
            let [mean, variance, scale, shift] = [
                self.values(&format!("{norm}.running_mean"))?,
                self.values(&format!("{norm}.running_var"))?,
                self.values(&format!("{norm}.weight"))?,
                self.values(&format!("{norm}.bias"))?,
            ];
            let sizes = [&mean, &variance, &scale, &shift].map(Vec::len);
            ensure!(sizes == [outputs; 4], "{norm}: expected {outputs} channels, found {sizes:?}");
            for (o, row) in w.chunks_exact_mut(inputs).enumerate() {
                let factor = scale[o] / (variance[o] + BN_EPSILON).sqrt();
                row.iter_mut().for_each(|w| *w *= factor);
                b[o] = (b[o] - mean[o]) * factor + shift[o];
            }
        }
        Ok(Affine { inputs, outputs, dw: vec![0.0; w.len()], w, b, relu })
    }

    fn values(&self, name: &str) -> Result<Vec<f64>> {
        let tensor = self.tensors.get(name);
        let tensor = tensor.with_context(|| format!("{name}: no such tensor"))?;
        Ok(tensor.values.iter().map(|&x| f64::from(x)).collect())
    }

    /// The batch norm behind layer `name`: norms are numbered over the point-wise layers
    /// and then the dense layers of a stack.
    fn norm_of(&self, name: &str) -> String {
        let digits = name.trim_start_matches(|c: char| !c.is_ascii_digit());
        let number: usize = digits.parse().unwrap_or(0);
        let stem = name.trim_end_matches(digits);
        match stem.strip_suffix("fc") {
            Some(prefix) => {
                let before = self.layers(&format!("{prefix}conv")).len();
                format!("{prefix}bn{}", before + number)
            }
            None => format!("{}bn{number}", stem.trim_end_matches("conv")),
        }
    }

    /// The log-probabilities of `points`, without normalisation.
    pub fn log_probabilities(&self, points: &[[f32; 3]]) -> Result<Vec<f64>> {
        let value: Vec<f64> = points.as_flattened().iter().map(|&x| f64::from(x)).collect();
        let exact = Rows { width: 3, bound: vec![0.0; value.len()], value };
        let points = Points { exact, rounded: points.to_vec() };
        let trunk = self.chains().pop().context("a network has a trunk")?;
        let all = outputs(self, &trunk, &points, Precision::F32)?;
        let logits = &all.last().context("a network has layers")?.value;
        let top = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = logits.iter().map(|x| (x - top).exp()).sum();
        Ok(logits.iter().map(|x| x - top - total.ln()).collect())
    }

    /// The largest activation that int8 is calibrated to; 1 if it is not.
    pub fn range(&self, layer: &str) -> f64 {
        self.card.activation_ranges.get(layer).map_or(1.0, |&range| f64::from(range))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(tensors: &[(&str, &[usize], &[f32])]) -> Network {
        let tensor = |&(name, shape, values): &(&str, &[usize], &[f32])| {
            (name.to_owned(), Tensor { shape: shape.to_vec(), values: values.to_vec() })
        };
        Network { card: ModelCard::default(), tensors: tensors.iter().map(tensor).collect() }
    }

    #[test]
    fn the_reference_agrees_with_pytorch() {
        let parity = test_support::need!(test_support::shared_data("parity"));
        let network = Network::read(&parity.join("pointnet.safetensors")).unwrap();
        let mut golden = WeightsFile::open(&parity.join("golden.safetensors")).unwrap();
        for n in [16, 64, 128, 1024] {
            let x = golden.read(&format!("x{n}")).unwrap().values;
            let points: Vec<[f32; 3]> = (0..n).map(|i| [x[i], x[n + i], x[2 * n + i]]).collect();
            let expected = golden.read(&format!("logp{n}")).unwrap().values;
            let given = network.log_probabilities(&points).unwrap();
            let worst = given.iter().zip(expected).map(|(a, b)| (a - f64::from(b)).abs());
            // PyTorch's own rounding: a few ulp of numbers near 4.
            assert!(worst.fold(0.0, f64::max) < 2e-6);
        }
    }

    #[test]
    fn a_batch_norm_is_folded_into_its_layer() {
        let network = network(&[
            ("feat.conv1.weight", &[2, 1], &[1.0, 2.0]),
            ("feat.conv1.bias", &[2], &[0.5, 0.0]),
            ("feat.bn1.running_mean", &[2], &[0.5, 1.0]),
            ("feat.bn1.running_var", &[2], &[4.0, 1.0]),
            ("feat.bn1.weight", &[2], &[1.0, 3.0]),
            ("feat.bn1.bias", &[2], &[0.0, 7.0]),
        ]);
        let layer = network.affine("feat.conv1", false).unwrap();
        let near = |found: &[f64], expected: [f64; 2]| {
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4)
        };
        assert!(near(&layer.w, [0.5, 6.0]), "{:?}", layer.w);
        assert!(near(&layer.b, [0.0, 4.0]), "{:?}", layer.b);
    }
}
