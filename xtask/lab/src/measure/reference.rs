//! PointNet in f64 by plain loops: the reference that engines' answers are compared with.

use anyhow::{Context, Result, ensure};
use formats::model_card::ModelCard;
use formats::rng::StreamKey;
use formats::weights::{Tensor, WeightsFile};
use rayon::prelude::*;
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
    card: ModelCard,
    tensors: BTreeMap<String, Tensor>,
}

struct Layer {
    inputs: usize,
    /// `[outputs, inputs]`.
    weights: Vec<f64>,
    biases: Vec<f64>,
}

impl Layer {
    /// `rows` `[n, inputs]` through the layer; `relu` says whether it ends in a ReLU.
    fn through(&self, rows: &[f64], relu: bool) -> Vec<f64> {
        let least = if relu { 0.0 } else { f64::NEG_INFINITY };
        let outputs = |row| {
            let each = self.weights.chunks_exact(self.inputs).zip(&self.biases);
            each.map(move |(weights, bias)| (bias + dot(weights, row)).max(least))
        };
        rows.par_chunks_exact(self.inputs).flat_map_iter(outputs).collect()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The maximum of each column of `rows` `[n, width]`.
fn pooled(rows: &[f64], width: usize) -> Vec<f64> {
    let mut most = vec![f64::NEG_INFINITY; width];
    for row in rows.chunks_exact(width) {
        most.iter_mut().zip(row).for_each(|(most, x)| *most = most.max(*x));
    }
    most
}

impl Network {
    pub fn read(path: &Path) -> Result<Self> {
        let mut file = WeightsFile::open(path)?;
        let card = ModelCard::from_metadata(path, &file.metadata())?;
        ensure!(card.edge_radii.is_empty(), "{}: expected no EdgeConv layers", path.display());
        let mut tensors = BTreeMap::new();
        // PyTorch counts batches in integers, which inference does not need.
        let is_needed = |name: &String| !name.ends_with(".num_batches_tracked");
        for name in file.shapes().into_keys().filter(is_needed) {
            tensors.insert(name.clone(), file.read(&name)?);
        }
        Ok(Self { card, tensors })
    }

    /// The log-probabilities of `points`, without normalisation.
    pub fn log_probabilities(&self, points: &[[f32; 3]]) -> Result<Vec<f64>> {
        let rows = points.as_flattened().iter().map(|&x| f64::from(x)).collect();
        let mut rows = self.turned(rows, 3, "feat.stn.")?;
        let trunk = self.layers("feat.conv")?;
        for (i, layer) in trunk.iter().enumerate() {
            if i == self.card.transform_after {
                rows = self.turned(rows, layer.inputs, "feat.fstn.")?;
            }
            rows = layer.through(&rows, i + 1 < trunk.len() || self.card.pooled_relu);
        }
        let width = trunk.last().context("feat.conv1: no such layer")?.biases.len();
        let logits = self.head("fc", pooled(&rows, width))?;
        let top = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = logits.iter().map(|x| (x - top).exp()).sum();
        Ok(logits.iter().map(|x| x - top - total.ln()).collect())
    }

    /// `rows` of `width` numbers, turned by the T-Net `prefix` if the network has it.
    fn turned(&self, rows: Vec<f64>, width: usize, prefix: &str) -> Result<Vec<f64>> {
        let convs = self.layers(&format!("{prefix}conv"))?;
        let Some(last) = convs.last() else { return Ok(rows) };
        let seen = convs.iter().fold(rows.clone(), |rows, layer| layer.through(&rows, true));
        let seen = pooled(&seen, last.biases.len());
        let mut matrix = self.head(&format!("{prefix}fc"), seen)?;
        let n = matrix.len();
        ensure!(n == width * width, "{prefix}fc: expected {width} x {width} outputs, found {n}");
        (0..width).for_each(|i| matrix[i * width + i] += 1.0);
        // A row times the matrix: its columns are a layer's weights.
        let weights = (0..n).map(|at| matrix[at % width * width + at / width]).collect();
        let turn = Layer { inputs: width, weights, biases: vec![0.0; width] };
        Ok(turn.through(&rows, false))
    }

    /// A pooled vector through the dense layers `stem`, of which the last has no ReLU.
    fn head(&self, stem: &str, vector: Vec<f64>) -> Result<Vec<f64>> {
        let layers = self.layers(stem)?;
        let through =
            |x: Vec<f64>, (i, layer): (usize, &Layer)| layer.through(&x, i + 1 < layers.len());
        Ok(layers.iter().enumerate().fold(vector, through))
    }

    fn count(&self, stem: &str) -> usize {
        let is_there = |i: &usize| self.tensors.contains_key(&format!("{stem}{i}.weight"));
        (1..).take_while(is_there).count()
    }

    /// The layers `stem`, their batch norms folded in. Norms are numbered over the point-wise
    /// layers and then the dense layers of a stack.
    fn layers(&self, stem: &str) -> Result<Vec<Layer>> {
        let prefix = stem.trim_end_matches("fc").trim_end_matches("conv");
        let before = if stem.ends_with("fc") { self.count(&format!("{prefix}conv")) } else { 0 };
        let layer = |i| self.layer(&format!("{stem}{i}"), &format!("{prefix}bn{}", before + i));
        (1..=self.count(stem)).map(layer).collect()
    }

    fn layer(&self, name: &str, norm: &str) -> Result<Layer> {
        let mut biases = self.values(&format!("{name}.bias"))?;
        let mut weights = self.values(&format!("{name}.weight"))?;
        let (n, inputs) = (biases.len(), weights.len() / biases.len().max(1));
        ensure!(n * inputs == weights.len(), "{name}: {} weights, {n} biases", weights.len());
        if self.tensors.contains_key(&format!("{norm}.running_var")) {
            let norms = ["running_mean", "running_var", "weight", "bias"];
            let norms = norms.map(|part| self.values(&format!("{norm}.{part}")));
            let norms = norms.into_iter().collect::<Result<Vec<_>>>()?;
            let fits = norms.iter().all(|part| part.len() == n);
            ensure!(fits, "{norm}: expected {n} channels");
            for (o, row) in weights.chunks_exact_mut(inputs).enumerate() {
                let factor = norms[2][o] / (norms[1][o] + BN_EPSILON).sqrt();
                row.iter_mut().for_each(|weight| *weight *= factor);
                biases[o] = (biases[o] - norms[0][o]) * factor + norms[3][o];
            }
        }
        Ok(Layer { inputs, weights, biases })
    }

    fn values(&self, name: &str) -> Result<Vec<f64>> {
        let tensor = self.tensors.get(name);
        let tensor = tensor.with_context(|| format!("{name}: no such tensor"))?;
        Ok(tensor.values.iter().map(|&x| f64::from(x)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let tensors = [
            ("fc1.weight", vec![1.0, 2.0]),
            ("fc1.bias", vec![0.5, 0.0]),
            ("bn1.running_mean", vec![0.5, 1.0]),
            ("bn1.running_var", vec![4.0, 1.0]),
            ("bn1.weight", vec![1.0, 3.0]),
            ("bn1.bias", vec![0.0, 7.0]),
        ];
        let tensor = |(name, values): (&str, Vec<f32>)| {
            (name.to_owned(), Tensor { shape: vec![values.len()], values })
        };
        let tensors = tensors.into_iter().map(tensor).collect();
        let network = Network { card: ModelCard::default(), tensors };
        let found = network.head("fc", vec![2.0]).unwrap();
        // 0.5 x + 0 and 6 x + 4.
        assert!((found[0] - 1.0).abs() < 1e-4 && (found[1] - 16.0).abs() < 1e-4, "{found:?}");
    }
}
