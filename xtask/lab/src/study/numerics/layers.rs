//! Errors of each layer's activations and of the logits, by parameter, in every precision.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result, bail};
use infer_cpu::{Classifier, Options, Precision, to_unit_sphere};

use super::clouds::cloud;
use super::probe;
use super::{Row, Setting, U64, settings};
use crate::measure::reference_network::affine::{Rows, U32, gamma};
use crate::measure::reference_network::{Chain, Network, Points, outputs};

/// Points of a cloud where their number is not the parameter.
const N: f64 = 64.0;

/// Every value of every parameter of a cloud.
const SETTINGS: [(&str, &[f64]); 3] = [
    ("N", &[16.0, 64.0, 256.0, 1024.0]),
    ("scale", &[1e-12, 1e-6, 1e6, 1e12]),
    ("offset", &[1e2, 1e4, 1e6, 1e8]),
];

/// Measures every chain of the model at `path` on so many clouds a setting.
pub fn measure(path: &Path, n_clouds: u32) -> Result<Vec<Row>> {
    let network = Network::read(path)?;
    if let Some(norm) = network.tensors.keys().find(|name| name.ends_with(".running_var")) {
        bail!("{}: {norm}: expected batch norms that are folded in", path.display());
    }
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

/// The layers of one chain.
pub(super) fn measure_chain(
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

/// What a classifier is given, and what it would be given in exact arithmetic.
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
