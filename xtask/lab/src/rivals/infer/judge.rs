//! Who says whether an engine computed the right thing: a plain PointNet in
//! f64, and the definition of farthest point sampling.

use super::model::{FSTN, HEAD, Layer, STN, TRUNK};
use anyhow::{Context, Result, ensure};
use formats::weights::WeightsFile;
use ndarray::{Array1, Array2, ArrayView2, Axis};
use std::collections::BTreeMap;
use std::path::Path;

/// PyTorch's default.
const BN_EPSILON: f64 = 1e-5;

/// A model in f64, batch norms folded.
pub struct Judge {
    /// Weights `[out, in]` and biases by the layer's key.
    layers: BTreeMap<&'static str, (Array2<f64>, Array1<f64>)>,
}

impl Judge {
    /// Reads a model with the key names of yanx27's `pointnet_cls`.
    ///
    /// # Errors
    /// If it cannot be read or is another model.
    pub fn open(model: &Path) -> Result<Self> {
        let mut file = WeightsFile::open(model)?;
        let mut layers = BTreeMap::new();
        for layer in STN.iter().chain(&FSTN).chain(&TRUNK).chain(&HEAD) {
            layers.insert(layer.key, folded(&mut file, layer)?);
        }
        Ok(Self { layers })
    }

    /// What the model gives for `points` `[n, 3]`.
    ///
    /// # Errors
    /// If the shapes of its layers do not follow each other.
    pub fn log_probabilities(&self, points: ArrayView2<'_, f32>) -> Result<Vec<f64>> {
        let points = points.mapv(f64::from);
        let turned = points.dot(&self.turn(&STN, &points)?);
        let [conv1, rest @ ..] = &TRUNK;
        let features = relu(self.layer(conv1, &turned)?);
        let features = features.dot(&self.turn(&FSTN, &features)?);
        let global = greatest(&self.stack(rest, features)?);
        let logits = self.stack(&HEAD, global)?;
        let logits = logits.row(0);
        let top = logits.fold(f64::NEG_INFINITY, |a, &b| a.max(b));
        let total = logits.mapv(|x| (x - top).exp()).sum();
        Ok(logits.mapv(|x| x - top - total.ln()).to_vec())
    }

    /// The matrix by which a T-Net turns `x`.
    fn turn(&self, t_net: &[Layer; 6], x: &Array2<f64>) -> Result<Array2<f64>> {
        let (shared, dense) = t_net.split_at(3);
        let features = relu(self.stack(shared, x.clone())?);
        let side = x.ncols();
        let matrix = self.stack(dense, greatest(&features))?;
        ensure!(matrix.len() == side * side, "{}: not {side}x{side}", t_net[5].key);
        Ok(matrix.into_shape_with_order((side, side))? + Array2::<f64>::eye(side))
    }

    /// `layers` with ReLUs between them, but none behind the last.
    fn stack(&self, layers: &[Layer], mut x: Array2<f64>) -> Result<Array2<f64>> {
        for (i, layer) in layers.iter().enumerate() {
            x = self.layer(layer, &if i > 0 { relu(x) } else { x })?;
        }
        Ok(x)
    }

    fn layer(&self, layer: &Layer, x: &Array2<f64>) -> Result<Array2<f64>> {
        let (weights, bias) = &self.layers[layer.key];
        let inputs = weights.ncols();
        ensure!(inputs == x.ncols(), "{}: {inputs} inputs for {}", layer.key, x.ncols());
        Ok(x.dot(&weights.t()) + bias)
    }
}

fn folded(file: &mut WeightsFile, layer: &Layer) -> Result<(Array2<f64>, Array1<f64>)> {
    let mut vector = |key: &str, name: &str| -> Result<Array1<f64>> {
        let tensor = file.read(&format!("{key}.{name}"))?;
        Ok(tensor.values.into_iter().map(f64::from).collect())
    };
    let mut bias = vector(layer.key, "bias")?;
    let weights = vector(layer.key, "weight")?;
    let columns = weights.len() / bias.len().max(1);
    let mut weights = weights
        .into_shape_with_order((bias.len(), columns))
        .with_context(|| format!("{}: weights and biases do not fit", layer.key))?;
    if let Some(norm) = layer.norm {
        let scale =
            vector(norm, "weight")? / (vector(norm, "running_var")? + BN_EPSILON).mapv(f64::sqrt);
        ensure!(scale.len() == bias.len(), "{norm}: not the size of {}", layer.key);
        bias = (bias - vector(norm, "running_mean")?) * &scale + vector(norm, "bias")?;
        weights *= &scale.insert_axis(Axis(1));
    }
    Ok((weights, bias))
}

fn relu(x: Array2<f64>) -> Array2<f64> {
    x.mapv_into(|x| x.max(0.0))
}

/// The greatest of each column, as a row.
fn greatest(x: &Array2<f64>) -> Array2<f64> {
    x.fold_axis(Axis(0), f64::NEG_INFINITY, |&a, &b| a.max(b)).insert_axis(Axis(0))
}

/// How far `answer` is from `truth`: the greatest difference.
///
/// # Errors
/// If they are of different lengths, or a number is not finite.
pub fn worst(answer: &[f64], truth: &[f64]) -> Result<f64> {
    ensure!(answer.len() == truth.len(), "{} answers for {}", answer.len(), truth.len());
    ensure!(answer.iter().all(|x| x.is_finite()), "an answer is not finite");
    Ok(answer.iter().zip(truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max))
}

/// By how much the points at `indices` fall short of being farthest points of
/// `points` `[n, 3]`, in that order and from the first of them on: 1 minus
/// their squared distance over the greatest there was.
///
/// # Errors
/// If there are not `keep` different points.
pub fn shortfall(points: ArrayView2<'_, f32>, indices: &[f64], keep: usize) -> Result<f64> {
    ensure!(indices.len() == keep, "{} points, not {keep}", indices.len());
    let mut squared_m2 = vec![f64::INFINITY; points.nrows()];
    let mut worst = 0.0_f64;
    for (k, &index) in indices.iter().enumerate() {
        let index = index as usize;
        ensure!(index < points.nrows(), "there is no point {index}");
        ensure!(squared_m2[index] > 0.0, "point {index} twice");
        if k > 0 {
            let greatest = squared_m2.iter().copied().fold(0.0, f64::max);
            worst = worst.max(1.0 - squared_m2[index] / greatest);
        }
        let chosen = points.row(index);
        for (squared, point) in squared_m2.iter_mut().zip(points.rows()) {
            let apart = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
            *squared = squared.min(point.iter().zip(chosen).map(apart).sum());
        }
    }
    Ok(worst)
}

#[cfg(test)]
mod tests {
    use super::super::model::write_random;
    use super::*;
    use ndarray::array;

    #[test]
    fn the_judge_agrees_with_pytorch() {
        let parity = test_support::need!(test_support::shared_data("parity"));
        let judge = Judge::open(&parity.join("pointnet.safetensors")).unwrap();
        let mut golden = WeightsFile::open(&parity.join("golden.safetensors")).unwrap();
        for n in [16, 64, 128, 1024] {
            let x = golden.read(&format!("x{n}")).unwrap();
            let channels = Array2::from_shape_vec((3, n), x.values).unwrap();
            let expected = golden.read(&format!("logp{n}")).unwrap().values;
            let expected: Vec<f64> = expected.into_iter().map(f64::from).collect();
            let given = judge.log_probabilities(channels.t()).unwrap();
            // PyTorch's own rounding: a few ulp of numbers near 4.
            assert!(worst(&given, &expected).unwrap() < 2e-6);
        }
    }

    #[test]
    fn the_random_model_tells_clouds_apart() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("m.safetensors");
        write_random(&file).unwrap();
        let judge = Judge::open(&file).unwrap();
        let flat = judge.log_probabilities(array![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].view());
        let deep = judge.log_probabilities(array![[0.0, 0.0, 1.0], [0.0, 0.5, 1.0]].view());
        let (flat, deep) = (flat.unwrap(), deep.unwrap());
        assert!((flat.iter().map(|x| x.exp()).sum::<f64>() - 1.0).abs() < 1e-12);
        // Far above the tolerances of any arithmetic.
        assert!(worst(&flat, &deep).unwrap() > 0.1);
    }

    #[test]
    fn farthest_points_are_known_in_any_start_and_their_order_matters() {
        let line = array![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0]];
        let fall = |indices: &[f64]| shortfall(line.view(), indices, indices.len());
        assert!(fall(&[0.0, 3.0, 1.0]).unwrap() < 1e-12);
        assert!(fall(&[3.0, 0.0, 2.0]).unwrap() < 1e-12);
        // 9 of 16 where the farthest was to be had.
        assert!((fall(&[0.0, 2.0]).unwrap() - 7.0 / 16.0).abs() < 1e-12);
        assert!(fall(&[0.0, 0.0]).unwrap_err().to_string().contains("point 0 twice"));
        assert!(fall(&[0.0, 9.0]).unwrap_err().to_string().contains("no point 9"));
    }
}
