//! PointNet from points to logits, with or without T-Nets and set abstractions.
//!
//! Weights have PyTorch's names and shapes: a layer that all points share is a convolution
//! `[outputs, inputs, 1]`, and a layer after a pooling is a `Gemm` `[outputs, inputs]`. Batch norms
//! are folded into the weights, and so is the identity that a T-Net adds to its matrix.

use infer_cpu::model_file::{Dense, Network, TNet};

use super::graph::{Graph, int};
use super::layers::{convolution, convolutions, fully_connected, gemm, pool, transposed};
use super::{edges, set_abstractions};

/// The network of a model file, in f32, with batch norms folded in.
pub type Net = Network<Dense, Dense>;

/// The inputs of a network, as values of the graph.
pub struct NetInputs {
    /// The points, `[batch, points, 3]`.
    pub points: String,
    /// All points of the cloud, `[batch, all, 3]`, for networks with EdgeConv layers.
    pub cloud: Option<String>,
    /// The centres of set abstractions, `[batch, centres, 3]`, for networks with any.
    pub centres: Option<String>,
    /// The pooled vector of the input T-Net, `[batch, features]`, if it is in the graph already.
    pub pooled_stn: Option<String>,
}

/// Adds `net`. The logits are value `logits`.
pub fn add(graph: &mut Graph, net: &Net, inputs: &NetInputs) {
    let features = trunk(graph, net, inputs, "feat");
    let mut x = match &inputs.centres {
        Some(centres) => {
            set_abstractions::add(graph, &net.abstractions, centres, &inputs.points, &features)
        }
        None => pool(graph, "feat.pool", &features),
    };
    for (i, dense) in net.head.iter().enumerate() {
        x = match i + 1 == net.head.len() {
            true => gemm(graph, dense, "logits", &x),
            false => fully_connected(graph, dense, &x),
        };
    }
}

/// The features of each point after the trunk, `[batch, features, points]`. The names of values
/// that are not outputs of layers begin with `prefix`.
pub fn trunk(graph: &mut Graph, net: &Net, inputs: &NetInputs, prefix: &str) -> String {
    let mut x = entry(graph, net, inputs, prefix);
    for (i, dense) in net.trunk.iter().enumerate() {
        if let Some(fstn) = net.fstn.as_ref().filter(|_| i == net.transform_after) {
            let matrix = t_net(graph, fstn, "feat.fstn", &x, None);
            let rows = transposed(graph, "feat.fstn.rows", &x);
            let turned = graph.add("MatMul", "feat.fstn.turned", &[&rows, &matrix], vec![]);
            x = transposed(graph, "feat.fstn.features", &turned);
        }
        x = convolution(graph, dense, &x, prefix);
    }
    x
}

/// The input of the trunk's first layer, channels first: the transformed coordinates, and the
/// EdgeConv features of the points before the transform.
fn entry(graph: &mut Graph, net: &Net, inputs: &NetInputs, prefix: &str) -> String {
    let mut points = inputs.points.clone();
    if let Some(stn) = &net.stn {
        let x = transposed(graph, "feat.stn.points", &points);
        let matrix = t_net(graph, stn, "feat.stn", &x, inputs.pooled_stn.as_deref());
        points = graph.add("MatMul", "feat.stn.turned", &[&points, &matrix], vec![]);
    }
    if let Some(cloud) = inputs.cloud.as_ref().filter(|_| !net.edges.is_empty()) {
        let around = edges::add(graph, &net.edges, &inputs.points, cloud, prefix);
        let values: Vec<&str> =
            std::iter::once(&points).chain(&around).map(String::as_str).collect();
        points = graph.add("Concat", &format!("{prefix}.edged"), &values, vec![int("axis", 2)]);
    }
    transposed(graph, &format!("{prefix}.entry"), &points)
}

/// The matrix that a T-Net predicts from `x` `[batch, channels, points]`.
fn t_net(
    graph: &mut Graph,
    net: &TNet<Dense, Dense>,
    name: &str,
    x: &str,
    pooled: Option<&str>,
) -> String {
    let mut x = match pooled {
        Some(pooled) => pooled.to_owned(),
        None => {
            let features = convolutions(graph, &net.convs, x, name);
            pool(graph, &format!("{name}.pool"), &features)
        }
    };
    for dense in &net.fcs {
        x = fully_connected(graph, dense, &x);
    }
    let k = net.k as i64;
    // In a reshape, 0 keeps the size of the batch.
    let shape = graph.whole(&[0, k, k]);
    graph.add("Reshape", &format!("{name}.matrix"), &[&x, &shape], vec![])
}
