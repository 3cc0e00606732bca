//! Errors of each layer's activations and of the logits, by parameter and by the number of products
//! in a sum, in every precision.

use super::{Row, Setting, U64, probe, settings};
use crate::measure::reference_network::affine::{Rows, U32, gamma};
use crate::measure::reference_network::{Chain, Network, Points, drawn, outputs};
use anyhow::{Context, Result};
use formats::model_card::ModelCard;
use formats::rng::StreamKey;
use infer_cpu::{Classifier, Options, Precision, to_unit_sphere};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Points of a cloud where their number is not the parameter.
const N: f64 = 64.0;

/// Every value of every parameter of a cloud.
const SETTINGS: [(&str, &[f64]); 3] = [
    ("N", &[16.0, 64.0, 256.0, 1024.0]),
    ("scale", &[1e-12, 1e-6, 1e6, 1e12]),
    ("offset", &[1e2, 1e4, 1e6, 1e8]),
];

/// Measures every chain of the model at `path` on `n_clouds` clouds of each setting.
pub fn measure(path: &Path, n_clouds: u32) -> Result<Vec<Row>> {
    let network = Network::read(path)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut rows = Vec::new();
    let chains = network.chains();
    for (i, chain) in chains.iter().enumerate() {
        let is_last = i + 1 == chains.len();
        let settings = settings(&SETTINGS);
        let measured = measure_chain(&network, &name, chain, is_last, &settings, n_clouds)?;
        // The T-Network of features shares its first layers with the trunk.
        let known: BTreeSet<String> = rows.iter().map(|row: &Row| row.layer.clone()).collect();
        rows.extend(measured.into_iter().filter(|row| !known.contains(&row.layer)));
    }
    Ok(rows)
}

fn measure_chain(
    network: &Network,
    name: &str,
    chain: &Chain,
    gives_logits: bool,
    settings: &[Setting],
    n_clouds: u32,
) -> Result<Vec<Row>> {
    let names: Vec<&String> = chain.convs.iter().chain(&chain.fcs).collect();
    let folder = tempfile::tempdir()?;
    let file = |n_layers: usize| folder.path().join(format!("{n_layers}.st"));
    for n_layers in 1..=names.len() {
        probe::write(network, chain, n_layers, &file(n_layers))?;
    }
    let mut rows = Vec::new();
    for precision in Precision::ALL {
        let load = |n_layers: usize| {
            let options = Options { precision, ..Options::default() };
            Classifier::load(&file(n_layers), &options).context("a probe of a network")
        };
        let mut probes = (1..=names.len()).map(load).collect::<Result<Vec<_>>>()?;
        for setting in settings {
            let answers = |number| -> Result<_> {
                let (input, points) = clouds(setting, number);
                Ok((input, outputs(network, chain, &points, precision)?))
            };
            let truth = (0..n_clouds).map(answers).collect::<Result<Vec<_>>>()?;
            for (i, (layer, probe)) in names.iter().zip(&mut probes).enumerate() {
                let is_logit = gives_logits && i + 1 == names.len();
                let mut row = Row {
                    quantity: if is_logit { "logit" } else { "activation" },
                    layer: format!("{name}/{layer}"),
                    precision: precision.to_string(),
                    setting: *setting,
                    errors: Vec::new(),
                    bound: 0.0,
                    magnitude: 0.0,
                    unit: "1",
                };
                let is_point_wise = i < chain.convs.len();
                // A vector layer of its own gives what comes before its ReLU.
                let cut = !is_point_wise && i + 1 < names.len();
                for (input, truth) in &truth {
                    let found = probe.classify_f64(input).with_context(|| row.layer.clone())?;
                    if found.precision != precision {
                        row.precision = format!("{precision} overflows");
                    }
                    let relu = |&x: &f32| f64::from(if cut { x.max(0.0) } else { x });
                    compare(&mut row, found.logits.iter().map(relu), &truth[i], is_point_wise);
                }
                rows.push(row);
            }
        }
    }
    Ok(rows)
}

/// Adds the errors of `found` to `row`.
fn compare(row: &mut Row, found: impl Iterator<Item = f64>, truth: &Rows, is_point_wise: bool) {
    // The product with the identity behind a point-wise layer, and its scale, round as well.
    let passed = if is_point_wise { gamma(6) } else { 0.0 };
    for ((found, value), bound) in found.zip(&truth.value).zip(&truth.bound) {
        row.errors.push((found - value).abs());
        row.bound = row.bound.max(bound + passed * value.abs());
        row.magnitude = row.magnitude.max(value.abs());
    }
}

/// The input of a classifier, and the same in exact arithmetic.
fn clouds(setting: &Setting, number: u32) -> (Vec<[f64; 3]>, Points) {
    let (scale, offset) = (setting.of("scale", 1.0), setting.of("offset", 0.0));
    let plain = cloud(number, setting.of("N", N) as usize);
    let moved = |p: &[f64; 3]| p.map(|x| x * scale + offset);
    let input: Vec<[f64; 3]> = plain.iter().map(moved).collect();
    let mut rounded = Vec::new();
    to_unit_sphere(&input, &mut rounded);
    let (value, radius) = normalized(&plain);
    // Of each coordinate, and of the mean, f64 keeps this much beside the offset;
    // the scale's product, the sum, the quotient round too.
    let lost = 8.0 * U64 * (1.0 + offset / (radius * scale));
    let bound = value.iter().map(|x| U32 * (x.abs() + lost) + lost).collect();
    (input, Points { exact: Rows { width: 3, value, bound }, rounded })
}

/// Mean to 0, largest radius to 1, in f64; and what the radius was.
fn normalized(points: &[[f64; 3]]) -> (Vec<f64>, f64) {
    let n = points.len() as f64;
    let mean = [0, 1, 2].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / n);
    let centred: Vec<[f64; 3]> =
        points.iter().map(|p| [0, 1, 2].map(|axis| p[axis] - mean[axis])).collect();
    let radius = centred.iter().map(|p| p.iter().map(|x| x * x).sum::<f64>()).fold(0.0, f64::max);
    let radius = radius.sqrt();
    (centred.as_flattened().iter().map(|x| x / radius).collect(), radius)
}

/// Cloud `number` of `n` points: on an ellipsoid, a box, a cone or a rod, stretched
/// at random.
fn cloud(number: u32, n: usize) -> Vec<[f64; 3]> {
    let key = StreamKey::new(0, "growth", number);
    let stretch = [0, 1, 2].map(|axis| 0.3 + key.unit(axis));
    let point = |i: usize| {
        let unit = |k: usize| 2.0 * key.unit((3 + 3 * i + k) as u64) - 1.0;
        let p = [unit(0), unit(1), unit(2)];
        let on_surface = match number % 4 {
            0 => {
                let radius = p.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
                p.map(|x| x / radius)
            }
            1 => {
                let mut p = p;
                p[i % 3] = p[i % 3].signum();
                p
            }
            2 => [p[0] * (1.0 - p[2]) / 2.0, p[1] * (1.0 - p[2]) / 2.0, p[2]],
            _ => [0.1 * p[0], 0.1 * p[1], p[2]],
        };
        [0, 1, 2].map(|axis| on_surface[axis] * stretch[axis])
    };
    (0..n).map(point).collect()
}

const WIDTHS: [usize; 5] = [16, 64, 256, 1024, 4096];
const OUTPUTS: usize = 64;

/// Measures a layer of each width behind one of coordinates.
pub fn by_width() -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for k in WIDTHS {
        let network = random(k);
        let convs = vec!["feat.conv1".to_owned(), "feat.conv2".to_owned()];
        let chain = Chain { convs, ..Chain::default() };
        let setting = Setting { parameter: "K", value: k as f64 };
        let measured = measure_chain(&network, "random", &chain, false, &[setting], 2)?;
        // The first layer has three inputs whatever the width.
        rows.extend(measured.into_iter().filter(|row| row.layer.ends_with("conv2")));
    }
    Ok(rows)
}

/// A network of coordinates, K features and some outputs, uniform as He et al. 2015
/// have it, so that activations keep their magnitude.
fn random(k: usize) -> Network {
    let mut tensors = BTreeMap::new();
    for (name, inputs, outputs) in [("feat.conv1", 3, k), ("feat.conv2", k, OUTPUTS)] {
        let mut add = |part: &str, shape: &[usize], largest: f64| {
            let name = format!("{name}.{part}");
            let key = StreamKey::new(0, &name, k as u32);
            tensors.insert(name, drawn(key, shape, |unit| largest * (2.0 * unit - 1.0)));
        };
        add("weight", &[outputs, inputs], (6.0 / inputs as f64).sqrt());
        add("bias", &[outputs], 0.1);
    }
    // Of weights of at most 1.42 and coordinates of a unit sphere.
    let largest = (1.42 * 3f64.sqrt() + 0.1) as f32;
    let ranges = BTreeMap::from([("feat.conv1".to_owned(), largest)]);
    Network { card: ModelCard { activation_ranges: ranges, ..ModelCard::default() }, tensors }
}
