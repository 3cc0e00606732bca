//! EdgeConv features, as `infer-cpu/src/edge_conv.rs` defines them: for each radius and channel the
//! maximum of `relu(w (q - p) / r + b)` over the points q of the cloud within the radius r of the
//! point p.
//!
//! The graph rounds as that code does: differences, squares, and their sum in the order x, y, z. A
//! point that is not a neighbor contributes an offset of 0, as p itself does.

use infer_cpu::model_file::Dense;

use super::graph::{Graph, int};

/// The axis of the cloud in `[batch, points, all, 3]`.
const ALL: i64 = 2;

/// Adds the layers `edges` with their radii, for `points` `[batch, points, 3]` among `cloud`
/// `[batch, all, 3]`; returns features `[batch, points, channels]`, one value a layer.
pub fn add(
    graph: &mut Graph,
    edges: &[(f32, Dense)],
    points: &str,
    cloud: &str,
    prefix: &str,
) -> Vec<String> {
    let name = |what: &str| format!("{prefix}.edge.{what}");
    let offset = offsets(graph, points, cloud, &name);
    let squared = squared_lengths(graph, &offset, &name);
    edges
        .iter()
        .map(|(radius, dense)| {
            let own = dense.name.rsplit('.').next().unwrap_or(&dense.name);
            let near = Near { offset: &offset, squared: &squared, radius: *radius };
            near.layer(graph, dense, &name(own))
        })
        .collect()
}

/// q - p, `[batch, points, all, 3]`, for all p of `points` and q of `cloud`.
pub fn offsets(
    graph: &mut Graph,
    points: &str,
    cloud: &str,
    name: &impl Fn(&str) -> String,
) -> String {
    let (rows, columns) = (graph.whole(&[1]), graph.whole(&[ALL]));
    let cloud = graph.add("Unsqueeze", &name("neighbours"), &[cloud, &rows], vec![]);
    let points = graph.add("Unsqueeze", &name("centres"), &[points, &columns], vec![]);
    graph.add("Sub", &name("offset"), &[&cloud, &points], vec![])
}

/// x x + y y + z z, `[batch, points, all, 1]`.
pub fn squared_lengths(graph: &mut Graph, offset: &str, name: &impl Fn(&str) -> String) -> String {
    let axes = ["x", "y", "z"].map(name);
    let outputs: Vec<&str> = axes.iter().map(String::as_str).collect();
    let thirds = graph.whole(&[1, 1, 1]);
    graph.add_of_many("Split", &outputs, &[offset, &thirds], vec![int("axis", 3)]);
    let [x, y, z] = axes
        .each_ref()
        .map(|axis| graph.add("Mul", &format!("{axis}.squared"), &[axis, axis], vec![]));
    let sum = graph.add("Add", &name("xy.squared"), &[&x, &y], vec![]);
    graph.add("Add", &name("squared"), &[&sum, &z], vec![])
}

/// The offsets within a radius.
struct Near<'a> {
    offset: &'a str,
    squared: &'a str,
    radius: f32,
}

impl Near<'_> {
    fn layer(&self, graph: &mut Graph, dense: &Dense, name: &str) -> String {
        let limit = graph.reals(
            &format!("{}.squared_radius", dense.name),
            &[1],
            &[self.radius * self.radius],
        );
        let zero = graph.reals("edge.zero", &[1], &[0.0]);
        let weight: Vec<f32> = (0..3)
            .flat_map(|k| (0..dense.outputs).map(move |c| dense.at(k, c) / self.radius))
            .collect();
        let weight_name = format!("{}.weight_over_radius", dense.name);
        let weight = graph.reals(&weight_name, &[3, dense.outputs], &weight);
        let bias = graph.reals(&format!("{}.bias", dense.name), &[dense.outputs], &dense.bias);
        let part = |part: &str| format!("{name}.{part}");

        let is_near = graph.add("LessOrEqual", &part("is_near"), &[self.squared, &limit], vec![]);
        let near = graph.add("Where", &part("near"), &[&is_near, self.offset, &zero], vec![]);
        let product = graph.add("MatMul", &part("product"), &[&near, &weight], vec![]);
        // Bias and ReLU are monotonic, so that they can follow the maximum.
        let all = graph.whole(&[ALL]);
        let keep = vec![int("keepdims", 0)];
        let largest = graph.add("ReduceMax", &part("largest"), &[&product, &all], keep);
        let biased = graph.add("Add", name, &[&largest, &bias], vec![]);
        graph.add("Relu", &part("relu"), &[&biased], vec![])
    }
}
