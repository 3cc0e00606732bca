//! Small models with generated weights.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use formats::model_card::ModelCard;
use formats::rng::StreamKey;
use formats::weights::{Tensor, write_weights};

/// Layers and channels of a PointNet that is fast enough for thousands of runs and has all parts.
const TRUNK: [usize; 4] = [3, 8, 16, 64];
const HIDDEN: [usize; 2] = [32, 16];

/// The tensors of a model with both T-Nets, by their names.
pub fn tensors(n_classes: usize) -> BTreeMap<String, Tensor> {
    let mut tensors = BTreeMap::new();
    let pooled = TRUNK[3];
    let fcs = |outputs| [pooled, HIDDEN[0], HIDDEN[1], outputs];
    let features = [TRUNK[1], TRUNK[1], TRUNK[2], TRUNK[3]];
    add_layers(&mut tensors, "feat.stn.conv", &TRUNK);
    add_layers(&mut tensors, "feat.stn.fc", &fcs(9));
    add_layers(&mut tensors, "feat.fstn.conv", &features);
    add_layers(&mut tensors, "feat.fstn.fc", &fcs(TRUNK[1] * TRUNK[1]));
    add_layers(&mut tensors, "feat.conv", &TRUNK);
    add_layers(&mut tensors, "fc", &fcs(n_classes));
    // This keeps both transforms near the identity.
    for t_net in ["feat.stn", "feat.fstn"] {
        scale(&mut tensors, &format!("{t_net}.fc3.weight"), 0.1);
        scale(&mut tensors, &format!("{t_net}.fc3.bias"), 0.1);
    }
    tensors
}

/// The card and the tensors of a model of two set abstractions.
#[allow(dead_code, reason = "some tests need only the other model")]
pub fn sets(n_classes: usize) -> (ModelCard, BTreeMap<String, Tensor>) {
    let mut tensors = BTreeMap::new();
    add_layers(&mut tensors, "feat.conv", &[3, 8, 16]);
    add_layers(&mut tensors, "sa1.conv", &[4, 16, 24]);
    add_layers(&mut tensors, "sa2.conv", &[4, 24, 70, 90]);
    add_layers(&mut tensors, "fc", &[180, HIDDEN[0], n_classes]);
    let abstractions = vec![(100, 0.4), (33, 0.9)];
    (ModelCard { abstractions, ..ModelCard::default() }, tensors)
}

pub fn scale(tensors: &mut BTreeMap<String, Tensor>, name: &str, factor: f32) {
    tensors.get_mut(name).unwrap().values.iter_mut().for_each(|value| *value *= factor);
}

pub fn write(path: &Path, tensors: &BTreeMap<String, Tensor>, card: &ModelCard) -> PathBuf {
    write_weights(path, tensors, &card.to_metadata()).unwrap();
    path.to_path_buf()
}

/// Layers `stem1`, `stem2`, … of `widths`, with uniform weights after He et al. 2015, so that
/// activations keep their magnitude.
fn add_layers(tensors: &mut BTreeMap<String, Tensor>, stem: &str, widths: &[usize]) {
    for (i, pair) in widths.windows(2).enumerate() {
        let (inputs, outputs) = (pair[0], pair[1]);
        let mut shape = vec![outputs, inputs];
        if stem.ends_with("conv") {
            shape.push(1);
        }
        let largest = (6.0 / inputs as f64).sqrt();
        let mut add = |part: &str, shape: Vec<usize>, largest: f64| {
            let name = format!("{stem}{}.{part}", i + 1);
            let key = StreamKey::new(0, &name, 0);
            let n: usize = shape.iter().product();
            let values = (0..n as u64).map(|j| (largest * (2.0 * key.unit(j) - 1.0)) as f32);
            tensors.insert(name, Tensor { shape, values: values.collect() });
        };
        add("weight", shape, largest);
        add("bias", vec![outputs], 0.1);
    }
}
