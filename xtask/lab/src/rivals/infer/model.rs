//! The model that all engines run where none is given: random weights of
//! `pointnet_cls`'s shapes, on which alone speed depends.

use crate::measure::baseline::{STACKS, drawn};
use anyhow::Result;
use formats::rng::StreamKey;
use formats::weights::write_weights;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

const SEED: u64 = 3;

/// The tensors of a batch norm, and the ranges that their numbers are drawn from.
const NORM: [(&str, Range<f64>); 4] = [
    ("weight", 0.8..1.2),
    ("bias", -0.1..0.1),
    ("running_mean", -0.1..0.1),
    ("running_var", 0.5..1.5),
];

/// Writes the random model to `file`.
pub fn write_random(file: &Path) -> Result<()> {
    let mut tensors = BTreeMap::new();
    let mut add = |name: String, shape: &[usize], range: Range<f64>| {
        let key = StreamKey::new(SEED, &name, 0);
        let number = |unit| range.start + (range.end - range.start) * unit;
        tensors.insert(name, drawn(key, shape, number));
    };
    // Inference goes without the last stack, that of a Critical Points Layer.
    for (stack, widths) in &STACKS[..6] {
        let is_conv = stack.ends_with("conv");
        // Norms of a T-Net are numbered through both of its stacks.
        let norms_before = if stack.ends_with("stn.fc") { 3 } else { 0 };
        let prefix = stack.trim_end_matches("conv").trim_end_matches("fc");
        for (i, pair) in (1..).zip(widths.windows(2)) {
            let (inputs, outputs) = (pair[0], pair[1]);
            let is_last = i + 1 == widths.len();
            // He et al. 2015: keeps the variance through ReLUs. A T-Net's last layer is
            // smaller, so that its matrix stays near the identity.
            let ends_t_net = is_last && stack.ends_with("stn.fc");
            let bound = (6.0 / inputs as f64).sqrt() * if ends_t_net { 0.02 } else { 1.0 };
            let shape = [outputs, inputs, 1];
            let shape = if is_conv { &shape[..] } else { &shape[..2] };
            add(format!("{stack}{i}.weight"), shape, -bound..bound);
            add(format!("{stack}{i}.bias"), &[outputs], -0.1..0.1);
            if is_conv || !is_last {
                for (tensor, range) in NORM {
                    add(format!("{prefix}bn{}.{tensor}", norms_before + i), &[outputs], range);
                }
            }
        }
    }
    let remark = ("note".to_owned(), "random weights, to measure speed".to_owned());
    Ok(write_weights(file, &tensors, &BTreeMap::from([remark]))?)
}
