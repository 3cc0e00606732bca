//! The reference network: everything in f64 by plain loops, with duplicated points instead of
//! weights.

use std::collections::BTreeMap;

use crate::layer::Module;
use crate::matrix::Matrix;
use crate::recipe::Shape;

/// Values by a parameter's name, with its shape.
pub type Values = BTreeMap<String, (Vec<usize>, Vec<f64>)>;

pub type Table = Vec<Vec<f64>>;

const EPSILON: f64 = 1e-5;

pub struct Reference<'a> {
    /// Parameters, and running statistics.
    pub values: &'a Values,
    /// The clouds' points, duplicates and all.
    pub clouds: Vec<Table>,
    /// The points among which each cloud searches neighbors, if the network has EdgeConv layers.
    pub around: Vec<Table>,
    /// The dropout mask. Without it, batch norms use the running statistics.
    pub kept: Option<Matrix>,
}

impl Reference<'_> {
    fn linear(&self, name: &str, x: &Table) -> Table {
        let (shape, weight) = &self.values[&format!("{name}.weight")];
        let (_, bias) = &self.values[&format!("{name}.bias")];
        let row = |x: &Vec<f64>| {
            let dot = |o: usize| {
                let weights = &weight[o * shape[1]..][..shape[1]];
                bias[o] + weights.iter().zip(x).map(|(w, x)| w * x).sum::<f64>()
            };
            (0..shape[0]).map(dot).collect()
        };
        x.iter().map(row).collect()
    }

    fn norm(&self, name: &str, z: Table, relu: bool) -> Table {
        let value = |part: &str, c: usize| self.values[&format!("{name}.{part}")].1[c];
        let n = z.len() as f64;
        let channel = |c: usize| {
            let (mean, variance) = if self.kept.is_some() {
                let mean = z.iter().map(|z| z[c]).sum::<f64>() / n;
                (mean, z.iter().map(|z| (z[c] - mean).powi(2)).sum::<f64>() / n)
            } else {
                (value("running_mean", c), value("running_var", c))
            };
            let scale = value("weight", c) / (variance + EPSILON).sqrt();
            (scale, value("bias", c) - scale * mean)
        };
        let channels: Vec<(f64, f64)> = (0..z[0].len()).map(channel).collect();
        let least = if relu { 0.0 } else { f64::NEG_INFINITY };
        let row = |z: &Vec<f64>| {
            z.iter()
                .zip(&channels)
                .map(|(z, (scale, shift))| (z * scale + shift).max(least))
                .collect()
        };
        z.iter().map(row).collect()
    }

    /// `n` point-wise layers, the last without a ReLU, and the maximum over each cloud.
    fn points(&self, mut x: Table, n: usize) -> Table {
        for i in 1..=n {
            let z = self.linear(&format!("feat.conv{i}"), &x);
            x = self.norm(&format!("feat.bn{i}"), z, i < n);
        }
        pooled(&x, self.clouds.iter().map(Vec::len))
    }

    /// What surrounds each point within `radius`.
    fn edges(&self, number: usize, radius: f32) -> Table {
        let mut offsets = Table::new();
        let mut counts = Vec::new();
        for (cloud, around) in self.clouds.iter().zip(&self.around) {
            for p in cloud {
                let before = offsets.len();
                offsets.push(vec![0.0; 3]);
                for q in around {
                    let offset = q.iter().zip(p).map(|(q, p)| (q - p) / f64::from(radius));
                    let squared: f64 = offset.clone().map(|x| x * x).sum();
                    if squared > 0.0 && squared <= 1.0 {
                        offsets.push(offset.collect());
                    }
                }
                counts.push(offsets.len() - before);
            }
        }
        let z = self.linear(&format!("edge.conv{number}"), &offsets);
        pooled(&self.norm(&format!("edge.bn{number}"), z, true), counts.into_iter())
    }

    pub fn logits(&self, shape: &Shape) -> Table {
        let mut x: Table = self.clouds.iter().flatten().cloned().collect();
        for (edge, number) in shape.edges.iter().zip(1..) {
            for (x, features) in x.iter_mut().zip(self.edges(number, edge.radius)) {
                x.extend(features);
            }
        }
        let h = self.points(x, shape.trunk.len());
        self.head(h, shape)
    }

    fn head(&self, mut h: Table, shape: &Shape) -> Table {
        for i in 1..=shape.head.len() {
            let mut z = self.linear(&format!("fc{i}"), &h);
            if let (true, Some(kept)) = (i == shape.head.len(), &self.kept) {
                for (z, kept) in z.iter_mut().flatten().zip(kept) {
                    *z *= f64::from(*kept);
                }
            }
            h = self.norm(&format!("bn{i}"), z, true);
        }
        self.linear(&format!("fc{}", shape.head.len() + 1), &h)
    }

    pub fn loss(&self, shape: &Shape, targets: &Matrix) -> f64 {
        let logits = self.logits(shape);
        let mut loss = 0.0;
        for (logits, target) in logits.iter().zip(targets.rows()) {
            let sum: f64 = logits.iter().map(|x| x.exp()).sum();
            let terms = logits.iter().zip(target);
            loss -= terms.map(|(x, &t)| f64::from(t) * (x - sum.ln())).sum::<f64>();
        }
        loss / logits.len() as f64
    }
}

/// The maxima of the rows in groups of these `counts`.
fn pooled(mut rows: &[Vec<f64>], counts: impl Iterator<Item = usize>) -> Table {
    let group = |n: usize| {
        let some = rows.split_off(..n).expect("a group has its rows");
        (0..some[0].len()).map(|c| some.iter().map(|r| r[c]).fold(f64::MIN, f64::max)).collect()
    };
    counts.map(group).collect()
}

pub fn values(network: &mut dyn Module) -> Values {
    let wide = |values: &[f32]| values.iter().map(|&x| f64::from(x)).collect();
    let tensors = crate::model_file::tensors(network).into_iter();
    tensors.map(|(name, tensor)| (name, (tensor.shape, wide(&tensor.values)))).collect()
}
