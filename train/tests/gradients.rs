//! Gradients against a twin: the whole network in f64 by plain loops, with
//! duplicated points where the product has weights, differentiated by
//! differences.

use std::collections::BTreeMap;

use formats::rng::StreamKey;
use train::batch::Batch;
use train::layer::Learns;
use train::matrix::Matrix;
use train::network::{PointNet, Rates, Shape};

/// Values by a parameter's name, with its shape.
type Values = BTreeMap<String, (Vec<usize>, Vec<f64>)>;

/// Rows of numbers.
type Table = Vec<Vec<f64>>;

const RATES: Rates = Rates { momentum: 0.1, orthogonality: 0.02 };
const EPSILON: f64 = 1e-5;

fn shape(input_transform: bool, feature_transform: bool) -> Shape {
    Shape {
        input_transform,
        feature_transform,
        trunk: vec![5, 7, 11],
        t_net: vec![6, 9],
        t_net_head: vec![8],
        head: vec![10, 6],
    }
}

const CLASSES: usize = 4;

/// Four clouds, in two of which the first point stands for some more.
fn batch() -> Batch {
    let key = StreamKey::new(7, "gradients", 0);
    let mut n = 0;
    let mut unit = || {
        n += 1;
        key.unit(n) as f32
    };
    let sizes = [5, 3, 6, 4];
    let mut batch = Batch { starts: vec![0], ..Batch::default() };
    for size in sizes {
        for point in 0..size {
            batch.coordinates.push([(); 3].map(|()| 2.0 * unit() - 1.0));
            let stands_for_more = point == 0 && size % 3 == 0;
            batch.weights.push(if stands_for_more { 4.0 } else { 1.0 });
        }
        batch.starts.push(batch.coordinates.len());
    }
    batch.targets = Matrix::from_shape_fn((sizes.len(), CLASSES), |(cloud, class)| {
        // One cloud's target is shared between classes.
        match (cloud, class) {
            (3, 0) => 0.25,
            (3, 2) => 0.75,
            (3, _) => 0.0,
            _ => f32::from(u8::from(class == (cloud + 1) % CLASSES)),
        }
    });
    batch
}

fn kept() -> Matrix {
    Matrix::from_shape_fn((4, 6), |(r, c)| if (r + 2 * c) % 4 == 0 { 0.0 } else { 1.0 / 0.6 })
}

/// The twin: a network by its parameters' names.
struct Twin<'a> {
    values: &'a Values,
    /// The clouds' points, duplicates and all.
    clouds: Vec<Table>,
    targets: &'a Matrix,
}

impl Twin<'_> {
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
        let mean: Vec<f64> =
            (0..channels).map(|c| z.iter().map(|z| z[c]).sum::<f64>() / n).collect();
        let variance = |c: usize| z.iter().map(|z| (z[c] - mean[c]).powi(2)).sum::<f64>() / n;
        let variance: Vec<f64> = (0..channels).map(variance).collect();
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

    fn loss(&self, shape: &Shape) -> f64 {
        let mut x: Table = self.clouds.iter().flatten().cloned().collect();
        let mut regulariser = 0.0;
        if shape.input_transform {
            x = self.turned("feat.stn.", &x, shape).0;
        }
        let z = self.linear("feat.conv1", &x);
        x = self.norm("feat.bn1", z, true);
        if shape.feature_transform {
            (x, regulariser) = self.turned("feat.fstn.", &x, shape);
        }
        let mut h = self.points("feat.", x, (2, shape.trunk.len() - 1), false);
        for i in 1..=shape.head.len() {
            let mut z = self.linear(&format!("fc{i}"), &h);
            if i == shape.head.len() {
                for (z, kept) in z.iter_mut().flatten().zip(kept()) {
                    *z *= f64::from(kept);
                }
            }
            h = self.norm(&format!("bn{i}"), z, true);
        }
        let logits = self.linear(&format!("fc{}", shape.head.len() + 1), &h);
        let mut loss = 0.0;
        for (logits, target) in logits.iter().zip(self.targets.rows()) {
            let sum: f64 = logits.iter().map(|x| x.exp()).sum();
            let terms = logits.iter().zip(target);
            loss -= terms.map(|(x, &t)| f64::from(t) * (x - sum.ln())).sum::<f64>();
        }
        loss / logits.len() as f64 + f64::from(RATES.orthogonality) * regulariser
    }
}

/// The batch's clouds with each point as often as it counts.
fn duplicated(batch: &Batch) -> Vec<Table> {
    let cloud = |pair: &[usize]| {
        let rows = pair[0]..pair[1];
        let copies = |row: usize| {
            let point: Vec<f64> = batch.coordinates[row].map(f64::from).to_vec();
            std::iter::repeat_n(point, batch.weights[row] as usize)
        };
        rows.flat_map(copies).collect()
    };
    batch.starts.windows(2).map(cloud).collect()
}

fn check(shape: &Shape) {
    let batch = batch();
    let mut network = PointNet::new(shape, CLASSES, 11);
    // Scales of either sign, and shifts that are not 0.
    let mut n = 0u32;
    network.parameters(&mut |parameter| {
        if parameter.name.contains("bn") {
            for value in &mut parameter.value {
                n += 1;
                *value += 0.3 * (f64::from(n) * 1.7).sin() as f32;
                if parameter.name.ends_with("weight") && n.is_multiple_of(5) {
                    *value = -*value;
                }
            }
        }
    });
    let loss = network.learn(&batch, Some(kept()), RATES);
    let mut values = Values::new();
    let mut gradients = BTreeMap::new();
    network.parameters(&mut |parameter| {
        let value = parameter.value.iter().map(|&x| f64::from(x)).collect();
        values.insert(parameter.name.clone(), (parameter.shape.clone(), value));
        gradients.insert(parameter.name.clone(), parameter.gradient.clone());
    });
    let clouds = duplicated(&batch);
    let twin = |values: &Values| {
        Twin { values, clouds: clouds.clone(), targets: &batch.targets }.loss(shape)
    };
    // Some 30 layers deep, each of fewer than 100 roundings of relative size
    // 6e-8, magnified by batch norms of four vectors.
    assert!((loss.total - twin(&values)).abs() < 1e-4, "{} for {}", loss.total, twin(&values));
    for (name, gradient) in &gradients {
        let largest = gradient.iter().fold(0.0f32, |a, g| a.max(g.abs()));
        let every = gradient.len().div_ceil(12);
        for i in (0..gradient.len()).step_by(every) {
            // Central differences: off by h² of the third derivative, and by
            // the loss's 1e-16 / h.
            let h = 1e-5;
            let mut at = |by: f64| {
                values.get_mut(name).expect("it is there").1[i] += by;
                let loss = twin(&values);
                values.get_mut(name).expect("it is there").1[i] -= by;
                loss
            };
            let expected = (at(h) - at(-h)) / (2.0 * h);
            let found = f64::from(gradient[i]);
            let tolerance = 2e-4 + 2e-3 * f64::from(largest);
            assert!((found - expected).abs() < tolerance, "{name}[{i}]: {found} for {expected}");
        }
    }
}

#[test]
fn gradients_of_the_baseline_are_those_of_its_twin() {
    check(&shape(true, true));
}

#[test]
fn gradients_without_a_t_net_are_those_of_the_twin() {
    check(&shape(false, true));
    check(&shape(true, false));
    check(&shape(false, false));
}
