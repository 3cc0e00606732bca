//! The reference network: everything in f64 by plain loops, with duplicated points instead of
//! weights.

use std::collections::BTreeMap;

use train::layer::Module;
use train::matrix::Matrix;
use train::shape::Shape;

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
        let (_, scale) = &self.values[&format!("{name}.weight")];
        let (_, shift) = &self.values[&format!("{name}.bias")];
        let n = z.len() as f64;
        let channels = scale.len();
        let (mean, variance): (Vec<f64>, Vec<f64>) = if self.kept.is_some() {
            let mean: Vec<f64> =
                (0..channels).map(|c| z.iter().map(|z| z[c]).sum::<f64>() / n).collect();
            let of = |c: usize| z.iter().map(|z| (z[c] - mean[c]).powi(2)).sum::<f64>() / n;
            let variance = (0..channels).map(of).collect();
            (mean, variance)
        } else {
            let of = |part: &str| self.values[&format!("{name}.running_{part}")].1.clone();
            (of("mean"), of("var"))
        };
        let row = |z: &Vec<f64>| {
            let y =
                |c: usize| (z[c] - mean[c]) / (variance[c] + EPSILON).sqrt() * scale[c] + shift[c];
            (0..channels).map(|c| if relu { y(c).max(0.0) } else { y(c) }).collect()
        };
        z.iter().map(row).collect()
    }

    /// Point-wise layers from number `first` and the maximum over each cloud.
    fn points(&self, prefix: &str, mut x: Table, layers: (usize, usize), relu: bool) -> Table {
        let (first, n) = layers;
        for i in 0..n {
            let z = self.linear(&format!("{prefix}conv{}", first + i), &x);
            x = self.norm(&format!("{prefix}bn{}", first + i), z, relu || i + 1 < n);
        }
        let mut rows = x.into_iter();
        let pool = |cloud: &Table| {
            let rows: Table = rows.by_ref().take(cloud.len()).collect();
            let largest = |c| rows.iter().map(|row: &Vec<f64>| row[c]).fold(f64::MIN, f64::max);
            (0..rows[0].len()).map(largest).collect()
        };
        self.clouds.iter().map(pool).collect()
    }

    /// Rows behind the transforms of a T-Net, and the regulariser.
    fn turned(&self, prefix: &str, x: &Table, shape: &Shape) -> (Table, f64) {
        let n = shape.t_net.len();
        let mut h = self.points(prefix, x.clone(), (1, n), true);
        for i in 1..=shape.t_net_head.len() {
            let z = self.linear(&format!("{prefix}fc{i}"), &h);
            h = self.norm(&format!("{prefix}bn{}", n + i), z, true);
        }
        let k = x[0].len();
        let mut transforms = self.linear(&format!("{prefix}fc{}", shape.t_net_head.len() + 1), &h);
        for transform in &mut transforms {
            (0..k).for_each(|i| transform[i * k + i] += 1.0);
        }
        let mut out = Vec::new();
        let mut rows = x.iter();
        for (cloud, t) in self.clouds.iter().zip(&transforms) {
            for row in rows.by_ref().take(cloud.len()) {
                out.push((0..k).map(|j| (0..k).map(|i| row[i] * t[i * k + j]).sum()).collect());
            }
        }
        let error = |t: &Vec<f64>| {
            let element = |i: usize, j: usize| {
                let dot: f64 = (0..k).map(|m| t[i * k + m] * t[j * k + m]).sum();
                dot - f64::from(u8::from(i == j))
            };
            (0..k * k).map(|e| element(e / k, e % k).powi(2)).sum::<f64>().sqrt()
        };
        let mean = transforms.iter().map(error).sum::<f64>() / transforms.len() as f64;
        (out, mean)
    }

    /// What surrounds each point within `radius`.
    fn edges(&self, number: usize, radius: f32) -> Table {
        let mut offsets = Table::new();
        let mut counts = Vec::new();
        for (cloud, around) in self.clouds.iter().zip(&self.around) {
            for p in cloud {
                let offset = |q: &Vec<f64>| -> Vec<f64> {
                    q.iter().zip(p).map(|(q, p)| (q - p) / f64::from(radius)).collect()
                };
                let near = |offset: &Vec<f64>| {
                    let squared: f64 = offset.iter().map(|x| x * x).sum();
                    squared > 0.0 && squared <= 1.0
                };
                let before = offsets.len();
                offsets.push(vec![0.0; 3]);
                offsets.extend(around.iter().map(offset).filter(near));
                counts.push(offsets.len() - before);
            }
        }
        let z = self.linear(&format!("edge.conv{number}"), &offsets);
        let mut rows = self.norm(&format!("edge.bn{number}"), z, true).into_iter();
        let largest = |&n: &usize| {
            let some: Table = rows.by_ref().take(n).collect();
            (0..some[0].len()).map(|c| some.iter().map(|r| r[c]).fold(f64::MIN, f64::max)).collect()
        };
        counts.iter().map(largest).collect()
    }

    /// The maxima and means of the features of the last abstraction's centres.
    fn abstracted(&self, shape: &Shape) -> Table {
        let mut h: Table = self.clouds.iter().flatten().cloned().collect();
        for i in 1..=shape.trunk.len() {
            let z = self.linear(&format!("feat.conv{i}"), &h);
            h = self.norm(&format!("feat.bn{i}"), z, true);
        }
        let mut rows = h.into_iter();
        // Duplicates count in statistics alone.
        let distinct = |cloud: &Table| {
            let mut some: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
            for (p, u) in cloud.iter().zip(rows.by_ref()) {
                if some.iter().all(|(q, _)| q != p) {
                    some.push((p.clone(), u));
                }
            }
            in_farthest_order(some)
        };
        let mut levels: Vec<_> = self.clouds.iter().map(distinct).collect();
        for (abstraction, number) in shape.abstractions.iter().zip(1..) {
            let part = |part: &str| &self.values[&format!("sa{number}.{part}")].1;
            let (weight, bias, scale) =
                (part("conv1.weight"), part("conv1.bias"), part("bn1.weight"));
            let radius = f64::from(abstraction.radius);
            let mut z = Table::new();
            for cloud in &levels {
                for (p, _) in cloud.iter().take(abstraction.centres) {
                    let near = || cloud.iter().filter(|(q, _)| distance(p, q) <= radius);
                    let pooled = |c: usize| {
                        let (w, sign) = (&weight[4 * c..][..4], scale[c].signum());
                        let along = |q: &[f64], k: usize| w[1 + k] * (q[k] - p[k]) / radius;
                        let products = near().map(|(q, u)| {
                            sign * (w[0] * u[c] + (0..3).map(|k| along(q, k)).sum::<f64>())
                        });
                        sign * products.fold(f64::MIN, f64::max) + bias[c]
                    };
                    z.push((0..scale.len()).map(pooled).collect());
                }
            }
            let mut h = self.norm(&format!("sa{number}.bn1"), z, true);
            for i in 2..2 + abstraction.widths.len() {
                let z = self.linear(&format!("sa{number}.conv{i}"), &h);
                h = self.norm(&format!("sa{number}.bn{i}"), z, true);
            }
            let mut rows = h.into_iter();
            for cloud in &mut levels {
                cloud.truncate(abstraction.centres);
                cloud.iter_mut().for_each(|(_, u)| *u = rows.next().unwrap());
            }
        }
        let pooled = |cloud: &Vec<(Vec<f64>, Vec<f64>)>| {
            let column = |c: usize| cloud.iter().map(move |(_, u)| u[c]);
            let channels = 0..cloud[0].1.len();
            let largest = channels.clone().map(|c| column(c).fold(f64::MIN, f64::max));
            largest.chain(channels.map(|c| column(c).sum::<f64>() / cloud.len() as f64)).collect()
        };
        levels.iter().map(pooled).collect()
    }

    /// Logits, and the regulariser.
    pub fn logits(&self, shape: &Shape) -> (Table, f64) {
        if !shape.abstractions.is_empty() {
            return (self.head(self.abstracted(shape), shape), 0.0);
        }
        let mut x: Table = self.clouds.iter().flatten().cloned().collect();
        let mut regulariser = 0.0;
        if shape.input_transform {
            x = self.turned("feat.stn.", &x, shape).0;
        }
        for (edge, number) in shape.edges.iter().zip(1..) {
            for (x, features) in x.iter_mut().zip(self.edges(number, edge.radius)) {
                x.extend(features);
            }
        }
        let z = self.linear("feat.conv1", &x);
        x = self.norm("feat.bn1", z, true);
        if shape.feature_transform {
            (x, regulariser) = self.turned("feat.fstn.", &x, shape);
        }
        let h = self.points("feat.", x, (2, shape.trunk.len() - 1), false);
        (self.head(h, shape), regulariser)
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

    /// The loss, of which `orthogonality` is the regulariser's weight.
    pub fn loss(&self, shape: &Shape, targets: &Matrix, orthogonality: f32) -> f64 {
        let (logits, regulariser) = self.logits(shape);
        let mut loss = 0.0;
        for (logits, target) in logits.iter().zip(targets.rows()) {
            let sum: f64 = logits.iter().map(|x| x.exp()).sum();
            let terms = logits.iter().zip(target);
            loss -= terms.map(|(x, &t)| f64::from(t) * (x - sum.ln())).sum::<f64>();
        }
        loss / logits.len() as f64 + f64::from(orthogonality) * regulariser
    }
}

pub fn values(network: &mut dyn Module) -> Values {
    let wide = |values: &[f32]| values.iter().map(|&x| f64::from(x)).collect();
    let tensors = train::model_file::tensors(network).into_iter();
    tensors.map(|(name, tensor)| (name, (tensor.shape, wide(&tensor.values)))).collect()
}

fn distance(p: &[f64], q: &[f64]) -> f64 {
    p.iter().zip(q).map(|(p, q)| (p - q).powi(2)).sum::<f64>().sqrt()
}

/// `points` with their features, each the farthest from those before, and the first from the mean.
fn in_farthest_order(mut points: Vec<(Vec<f64>, Vec<f64>)>) -> Vec<(Vec<f64>, Vec<f64>)> {
    let n = points.len() as f64;
    let mean = [0, 1, 2].map(|k| points.iter().map(|(p, _)| p[k]).sum::<f64>() / n);
    let mut order: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    while !points.is_empty() {
        let nearest = |p: &Vec<f64>| match order.is_empty() {
            true => distance(p, &mean),
            false => order.iter().map(|(q, _)| distance(p, q)).fold(f64::MAX, f64::min),
        };
        let far = |&i: &usize, &j: &usize| nearest(&points[i].0).total_cmp(&nearest(&points[j].0));
        let next = (0..points.len()).max_by(far).unwrap();
        order.push(points.swap_remove(next));
    }
    order
}
