//! A Critical Points Layer before the network: it selects the M points of a cloud with the largest
//! scores in a max-pooling, like `infer-cpu --sampler cpl`.
//!
//! Scores are summed in f32, and in f64 in infer-cpu. Ties are broken by the index of a point, and
//! by geometry in infer-cpu. For clouds of distinct points that are sorted by x, y, z, both break
//! ties the same way.

use anyhow::bail;

use super::graph::{Graph, int, word};
use super::layers::{convolutions, pool, transposed};
use super::pointnet::{Net, NetInputs, trunk};

/// The output with the indices of the selected points.
pub const KEPT: &str = "kept";

/// Adds the selection of `n_points` points of `cloud` `[batch, all, 3]`, and returns the inputs of
/// the network. Value [`KEPT`] holds the indices of the points.
pub fn add(
    graph: &mut Graph,
    net: &Net,
    cloud: &str,
    n_points: usize,
) -> anyhow::Result<NetInputs> {
    if !net.abstractions.is_empty() {
        bail!("it has set abstractions, which a Critical Points Layer cannot pool");
    }
    let (features, is_stn) = front(graph, net, cloud)?;
    let pooled = pool(graph, "cpl.pool", &features);
    let score = scores(graph, cloud, &features, &pooled);
    best(graph, cloud, &score, n_points);
    let points = gathered(graph, cloud);
    // If the input T-Net is the front end, it pools all points.
    let (cloud, pooled_stn) = (Some(cloud.to_owned()), is_stn.then_some(pooled));
    Ok(NetInputs { points, cloud, centres: None, pooled_stn })
}

/// The features to pool, `[batch, features, all]`, by infer-cpu's choice of a front end, and
/// whether they are those of the input T-Net.
fn front(graph: &mut Graph, net: &Net, cloud: &str) -> anyhow::Result<(String, bool)> {
    let (layers, prefix) = match (&net.front, &net.stn, &net.fstn) {
        (Some(layers), ..) => (layers, "cpl"),
        (None, Some(stn), _) => (&stn.convs, "feat.stn"),
        (None, None, None) => {
            let points = cloud.to_owned();
            let all =
                NetInputs { cloud: Some(points.clone()), points, centres: None, pooled_stn: None };
            return Ok((trunk(graph, net, &all, "cpl"), false));
        }
        (None, None, Some(_)) => {
            bail!("it has neither a front end of its own nor a T-Net of coordinates")
        }
    };
    let entry = transposed(graph, "cpl.entry", cloud);
    Ok((convolutions(graph, layers, &entry, prefix), net.front.is_none()))
}

/// The score of each point, `[batch, all]`: the sum of the maxima above 0 that it wins.
fn scores(graph: &mut Graph, cloud: &str, features: &str, pooled: &str) -> String {
    let winners = vec![int("axis", 2), int("keepdims", 0)];
    let winners = graph.add("ArgMax", "cpl.winners", &[features], winners);
    let worth = graph.add("Relu", "cpl.worth", &[pooled], vec![]);
    let shape = vec![int("start", 0), int("end", 2)];
    let shape = graph.add("Shape", "cpl.batch_and_all", &[cloud], shape);
    let none = graph.add("ConstantOfShape", "cpl.no_score", &[&shape], vec![]);
    let sum = vec![int("axis", 1), word("reduction", "add")];
    graph.add("ScatterElements", "cpl.score", &[&none, &winners, &worth], sum)
}

/// The indices of the `n_points` best points, `[batch, M]`. If fewer points have a score, copies of
/// the best point fill the rest, which changes no maximum.
fn best(graph: &mut Graph, cloud: &str, score: &str, n_points: usize) {
    let all = vec![int("start", 1), int("end", 2)];
    let all = graph.add("Shape", "cpl.all", &[cloud], all);
    let wanted = graph.whole(&[n_points as i64]);
    let k = graph.add("Min", "cpl.k", &[&wanted, &all], vec![]);
    graph.add_of_many(
        "TopK",
        &["cpl.best_score", "cpl.best"],
        &[score, &k],
        vec![int("axis", 1), int("largest", 1), int("sorted", 1)],
    );
    let zero = graph.reals("cpl.zero", &[1], &[0.0]);
    let is_critical = graph.add("Greater", "cpl.is_critical", &["cpl.best_score", &zero], vec![]);
    let (from, to, axis) = (graph.whole(&[0]), graph.whole(&[1]), graph.whole(&[1]));
    let first = graph.add("Slice", "cpl.first", &["cpl.best", &from, &to, &axis], vec![]);
    graph.add("Where", KEPT, &[&is_critical, "cpl.best", &first], vec![]);
}

/// The points [`KEPT`] of `cloud`, `[batch, M, 3]`.
fn gathered(graph: &mut Graph, cloud: &str) -> String {
    let axis = graph.whole(&[2]);
    let column = graph.add("Unsqueeze", "cpl.kept_column", &[KEPT, &axis], vec![]);
    let width = graph.whole(&[1, 1, 3]);
    let index = graph.add("Expand", "cpl.kept_index", &[&column, &width], vec![]);
    graph.add("GatherElements", "points", &[cloud, &index], vec![int("axis", 1)])
}
