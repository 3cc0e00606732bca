//! How errors grow with K, the number of products in a sum: a layer of random
//! weights of each width.

use std::collections::BTreeMap;

use anyhow::Result;
use formats::model_card::ModelCard;
use formats::rng::StreamKey;

use super::layers::measure_chain;
use super::{Row, Setting};
use crate::measure::baseline::drawn;
use crate::measure::reference_network::{Chain, Network};

const WIDTHS: [usize; 5] = [16, 64, 256, 1024, 4096];
const OUTPUTS: usize = 64;

/// Measures a layer of each width behind one of coordinates.
pub fn measure() -> Result<Vec<Row>> {
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
