//! Errors of each layer's activations and of the logits, by parameter, in every precision.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result, bail};
use infer_cpu::{Classifier, Options, Precision, to_unit_sphere};

use super::Row;
use super::clouds::cloud;
use super::probe::{self, Part};
use crate::measure::reference_network::affine::{Rows, U32, gamma};
use crate::measure::reference_network::{Chain, Network, Output, Points, outputs};

/// Points of a cloud where their number is not the parameter.
const N: usize = 64;
/// Half a unit in the last place of f64, relative.
const U64: f64 = 1.0 / (1u64 << 53) as f64;

/// One value of one parameter.
pub(super) struct Setting {
    parameter: &'static str,
    value: f64,
    n: usize,
    scale: f64,
    offset: f64,
}

/// Measures every chain of the model at `path` on so many clouds a setting.
///
/// # Errors
/// A model that cannot be read.
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
        let measured = measure_chain(&network, &name, chain, is_last, &settings(), n_clouds)?;
        // The T-Network of features shares its first layers with the trunk.
        let known: BTreeSet<String> = rows.iter().map(|row: &Row| row.layer.clone()).collect();
        rows.extend(measured.into_iter().filter(|row| !known.contains(&row.layer)));
    }
    Ok(rows)
}

fn settings() -> Vec<Setting> {
    let plain = |parameter, value| Setting { parameter, value, n: N, scale: 1.0, offset: 0.0 };
    let mut all = Vec::new();
    all.extend([16, 64, 256, 1024].map(|n| Setting { n, ..plain("N", n as f64) }));
    let scales = [1e-12, 1e-6, 1e6, 1e12];
    all.extend(scales.map(|scale| Setting { scale, ..plain("scale", scale) }));
    let offsets = [1e2, 1e4, 1e6, 1e8];
    all.extend(offsets.map(|offset| Setting { offset, ..plain("offset", offset) }));
    all
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
    let parts: Vec<Part> = (1..=chain.convs.len())
        .map(Part::Points)
        .chain((1..=chain.fcs.len()).map(Part::Vectors))
        .collect();
    let folder = tempfile::tempdir()?;
    let files: Vec<_> = (0..parts.len()).map(|i| folder.path().join(format!("{i}.st"))).collect();
    for (part, file) in parts.iter().zip(&files) {
        probe::write(network, chain, *part, file)?;
    }
    let mut rows = Vec::new();
    for precision in Precision::ALL {
        let load = |file: &std::path::PathBuf| {
            let options = Options { precision, ..Options::default() };
            Classifier::load(file, &options).context("a probe of a network")
        };
        let mut probes = files.iter().map(load).collect::<Result<Vec<_>>>()?;
        for setting in settings {
            let mut found: Vec<Found> = parts.iter().map(|_| Found::default()).collect();
            for number in 0..n_clouds {
                let (input, points) = setting.clouds(number);
                let truth = outputs(network, chain, &points, precision)?;
                for (part, ((probe, truth), met)) in
                    parts.iter().zip(probes.iter_mut().zip(&truth).zip(&mut found))
                {
                    met.compare(probe, &input, truth, *part, chain, precision)?;
                }
            }
            let names = chain.convs.iter().chain(&chain.fcs);
            for (i, (layer, met)) in names.zip(found).enumerate() {
                let is_logit = gives_logits && i + 1 == parts.len();
                rows.push(Row {
                    quantity: if is_logit { "logit" } else { "activation" },
                    layer: format!("{name}/{layer}"),
                    precision: met.precision(precision),
                    parameter: setting.parameter,
                    value: setting.value,
                    errors: met.errors,
                    bound: met.bound,
                    magnitude: met.magnitude,
                    unit: "1",
                });
            }
        }
    }
    Ok(rows)
}

/// What a comparison found.
#[derive(Default)]
struct Found {
    errors: Vec<f64>,
    bound: f64,
    magnitude: f64,
    overflowed: bool,
}

impl Found {
    fn compare(
        &mut self,
        probe: &mut Classifier,
        input: &[[f64; 3]],
        truth: &Output,
        part: Part,
        chain: &Chain,
        precision: Precision,
    ) -> Result<()> {
        let found = probe.classify_f64(input).with_context(|| truth.layer.clone())?;
        self.overflowed |= found.precision != precision;
        // A layer of its own gives what comes before its ReLU.
        let cut = matches!(part, Part::Vectors(n) if n < chain.fcs.len());
        // An identity's product and its scale round what they pass on.
        let passed = if matches!(part, Part::Points(_)) { gamma(6) } else { 0.0 };
        let Rows { value, bound, .. } = &truth.values;
        for ((&found, value), bound) in found.logits.iter().zip(value).zip(bound) {
            let found = f64::from(if cut { found.max(0.0) } else { found });
            self.errors.push((found - value).abs());
            self.bound = self.bound.max(bound + passed * value.abs());
            self.magnitude = self.magnitude.max(value.abs());
        }
        Ok(())
    }

    fn precision(&self, asked: Precision) -> String {
        if self.overflowed { format!("{asked} overflows") } else { asked.to_string() }
    }
}

impl Setting {
    /// What a classifier is given, and what it would be given in exact arithmetic.
    fn clouds(&self, number: u32) -> (Vec<[f64; 3]>, Points) {
        let plain = cloud(number, self.n);
        let moved = |p: &[f64; 3]| p.map(|x| x * self.scale + self.offset);
        let input: Vec<[f64; 3]> = plain.iter().map(moved).collect();
        let mut rounded = Vec::new();
        to_unit_sphere(&input, &mut rounded);
        let (value, radius) = normalized(&plain);
        // Of each coordinate, and of the mean, f64 keeps this much beside the offset;
        // the scale's product, the sum, the quotient round too.
        let lost = 8.0 * U64 * (1.0 + self.offset / (radius * self.scale));
        let bound = value.iter().map(|x| U32 * (x.abs() + lost) + lost).collect();
        (input, Points { exact: Rows { width: 3, value, bound }, rounded })
    }
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

/// A setting for a measurement of another parameter.
pub(super) fn of_parameter(parameter: &'static str, value: f64) -> Setting {
    Setting { parameter, value, n: N, scale: 1.0, offset: 0.0 }
}
