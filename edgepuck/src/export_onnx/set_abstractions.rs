//! Set abstractions, as `infer-cpu/src/set_abstraction.rs` defines them: for a centre p and channel
//! c, the maximum of `relu(a u + v (q - p) / r + b)` over the points q within the radius r of p,
//! where u is the feature of q.
//!
//! The graph sums in the order of that code: the maximum of `a u + v q / r`, then `- v p / r + b`.

use infer_cpu::model_file::{Dense, SetAbstraction};

use super::edges::{offsets, squared_lengths};
use super::graph::{Graph, int};
use super::layers::{convolutions, pool, transposed};

/// The axis of the points in `[batch, centres, points, channels]`.
const POINTS: i64 = 2;

/// Adds `levels`, whose centres are the first of `centres` `[batch, centres, 3]`, after `features`
/// `[batch, channels, points]` of `points` `[batch, points, 3]`. Returns the maxima and then the
/// means of the last level's features, `[batch, 2 * channels]`.
pub fn add(
    graph: &mut Graph,
    levels: &[SetAbstraction<Dense>],
    centres: &str,
    points: &str,
    features: &str,
) -> String {
    let mut level_before = (points.to_owned(), features.to_owned());
    for (level, number) in levels.iter().zip(1..) {
        let prefix = format!("sa{number}");
        let name = |what: &str| format!("{prefix}.{what}");
        let (from, to, axis) =
            (graph.whole(&[0]), graph.whole(&[level.centres as i64]), graph.whole(&[1]));
        let first =
            graph.add("Slice", &name("first_centres"), &[centres, &from, &to, &axis], vec![]);
        let pooled = pooled(graph, level, &first, &level_before, &name);
        let entry = transposed(graph, &name("entry"), &pooled);
        level_before = (first, convolutions(graph, &level.convs, &entry, &prefix));
    }
    let (_, features) = level_before;
    let largest = pool(graph, "feat.pool", &features);
    let axes = graph.whole(&[2]);
    let mean = graph.add("ReduceMean", "feat.mean", &[&features, &axes], vec![int("keepdims", 0)]);
    graph.add("Concat", "feat.pooled", &[&largest, &mean], vec![int("axis", 1)])
}

/// The features of the neighborhoods of `centres`, `[batch, centres, channels]`.
fn pooled(
    graph: &mut Graph,
    level: &SetAbstraction<Dense>,
    centres: &str,
    (points, features): &(String, String),
    name: &impl Fn(&str) -> String,
) -> String {
    let dense = &level.pool;
    let weights = |of: std::ops::Range<usize>, scale: f32| -> Vec<f32> {
        of.flat_map(|k| (0..dense.outputs).map(move |c| dense.at(k, c) / scale)).collect()
    };
    let own = weights(0..1, 1.0);
    let own = graph.reals(&format!("{}.weight_of_feature", dense.name), &[dense.outputs], &own);
    let axes = weights(1..4, level.radius);
    let axes =
        graph.reals(&format!("{}.weight_over_radius", dense.name), &[3, dense.outputs], &axes);
    let bias = graph.reals(&format!("{}.bias", dense.name), &[dense.outputs], &dense.bias);

    let rows = transposed(graph, &name("rows"), features);
    let own = graph.add("Mul", &name("own"), &[&rows, &own], vec![]);
    let along = graph.add("MatMul", &name("along"), &[points, &axes], vec![]);
    let product = graph.add("Add", &name("product"), &[&own, &along], vec![]);
    let largest = largest_near(graph, level.radius, centres, points, &product, name);

    let along_centre = graph.add("MatMul", &name("along_centre"), &[centres, &axes], vec![]);
    let moved = graph.add("Sub", &name("moved"), &[&largest, &along_centre], vec![]);
    let biased = graph.add("Add", &name("conv1"), &[&moved, &bias], vec![]);
    graph.add("Relu", &name("conv1.relu"), &[&biased], vec![])
}

/// The maximum of `product` `[batch, points, channels]` over the points within `radius` of each
/// centre, `[batch, centres, channels]`.
fn largest_near(
    graph: &mut Graph,
    radius: f32,
    centres: &str,
    points: &str,
    product: &str,
    name: &impl Fn(&str) -> String,
) -> String {
    let offset = offsets(graph, centres, points, name);
    let squared = squared_lengths(graph, &offset, name);
    let limit = graph.reals(&name("squared_radius"), &[1], &[radius * radius]);
    let is_near = graph.add("LessOrEqual", &name("is_near"), &[&squared, &limit], vec![]);
    let centre_axis = graph.whole(&[1]);
    let product = graph.add("Unsqueeze", &name("products"), &[product, &centre_axis], vec![]);
    let least = graph.reals("sa.least", &[1], &[f32::NEG_INFINITY]);
    let near = graph.add("Where", &name("near"), &[&is_near, &product, &least], vec![]);
    let all = graph.whole(&[POINTS]);
    graph.add("ReduceMax", &name("largest"), &[&near, &all], vec![int("keepdims", 0)])
}
