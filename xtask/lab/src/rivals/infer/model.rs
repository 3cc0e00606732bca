//! The model that all engines run where none is given: random weights of
//! `pointnet_cls`'s shapes, on which alone speed depends.

use crate::measure::baseline::{PARTS, WIDTHS};
use anyhow::Result;
use formats::rng::StreamKey;
use formats::weights::{Tensor, write_weights};
use std::collections::BTreeMap;
use std::path::Path;

const SEED: u64 = 3;

/// Writes the random model to `file`.
///
/// # Errors
/// If it cannot be written.
pub fn write_random(file: &Path) -> Result<()> {
    let mut tensors = BTreeMap::new();
    // Inference without a Critical Points Layer, which is the last part.
    for ([convs, fcs], [conv_widths, fc_widths]) in PARTS.into_iter().zip(WIDTHS).take(3) {
        write_stack(convs, conv_widths, 1, &mut tensors);
        // A T-Net's norms are numbered on; the head has its own.
        let is_head = fcs == "fc";
        write_stack(fcs, fc_widths, if is_head { 1 } else { conv_widths.len() }, &mut tensors);
    }
    let remark = ("note".to_owned(), "random weights, to measure speed".to_owned());
    Ok(write_weights(file, &tensors, &BTreeMap::from([remark]))?)
}

/// The layers `stem1`, `stem2`, ... of these widths, a batch norm behind each but the last
/// dense one; `first_norm` is the number of the first.
fn write_stack(
    stem: &str,
    widths: &[usize],
    first_norm: usize,
    tensors: &mut BTreeMap<String, Tensor>,
) {
    let is_conv = stem.ends_with("conv");
    let prefix = stem.trim_end_matches("conv").trim_end_matches("fc");
    for (i, pair) in widths.windows(2).enumerate() {
        let has_norm = is_conv || i + 2 < widths.len();
        let norm = has_norm.then(|| format!("{prefix}bn{}", first_norm + i));
        write_layer(&format!("{stem}{}", i + 1), norm.as_deref(), [pair[0], pair[1]], tensors);
    }
}

fn write_layer(
    key: &str,
    norm: Option<&str>,
    [inputs, outputs]: [usize; 2],
    tensors: &mut BTreeMap<String, Tensor>,
) {
    let mut add = |key: &str, name: &str, shape: Vec<usize>, range: std::ops::Range<f64>| {
        let name = format!("{key}.{name}");
        let stream = StreamKey::new(SEED, &name, 0);
        let count = shape.iter().product::<usize>() as u64;
        let draw = |n| (range.start + (range.end - range.start) * stream.unit(n)) as f32;
        tensors.insert(name, Tensor { shape, values: (0..count).map(draw).collect() });
    };
    // He et al. 2015: keeps the variance through ReLUs. A T-Net's last layer is
    // smaller, so that its matrix stays near the identity.
    let ends_t_net = key.ends_with("stn.fc3");
    let bound = (6.0 / inputs as f64).sqrt() * if ends_t_net { 0.02 } else { 1.0 };
    let shape = if key.contains("conv") { vec![outputs, inputs, 1] } else { vec![outputs, inputs] };
    add(key, "weight", shape, -bound..bound);
    add(key, "bias", vec![outputs], -0.1..0.1);
    if let Some(norm) = norm {
        add(norm, "weight", vec![outputs], 0.8..1.2);
        add(norm, "bias", vec![outputs], -0.1..0.1);
        add(norm, "running_mean", vec![outputs], -0.1..0.1);
        add(norm, "running_var", vec![outputs], 0.5..1.5);
    }
}
