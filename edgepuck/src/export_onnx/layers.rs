//! The layers of all networks, and the poolings between them.

use infer_cpu::model_file::Dense;

use super::graph::{Graph, int, ints};

/// Layers that all points share, in sequence.
pub fn convolutions(graph: &mut Graph, layers: &[Dense], x: &str, prefix: &str) -> String {
    layers.iter().fold(x.to_owned(), |x, dense| convolution(graph, dense, &x, prefix))
}

/// One layer that all points share. If a trunk runs twice, before and after a Critical Points
/// Layer, both runs share the weights, and differ in `prefix`.
pub fn convolution(graph: &mut Graph, dense: &Dense, x: &str, prefix: &str) -> String {
    let Dense { name, inputs, outputs, .. } = dense;
    let kernel = graph.reals(&format!("{name}.weight"), &[*outputs, *inputs, 1], &dense.weight);
    let bias = graph.reals(&format!("{name}.bias"), &[*outputs], &dense.bias);
    // Converters of other engines require the attributes that have defaults in ONNX.
    let attributes = vec![
        ints("kernel_shape", &[1]),
        ints("strides", &[1]),
        ints("pads", &[0, 0]),
        ints("dilations", &[1]),
        int("group", 1),
    ];
    let own = name.rsplit('.').next().unwrap_or(name);
    let out = format!("{prefix}.{own}");
    let y = graph.add("Conv", &out, &[x, &kernel, &bias], attributes);
    relu(graph, dense, y)
}

/// A layer after a pooling.
pub fn fully_connected(graph: &mut Graph, dense: &Dense, x: &str) -> String {
    let y = gemm(graph, dense, &dense.name, x);
    relu(graph, dense, y)
}

/// Such a layer without its ReLU, as value `out`.
pub fn gemm(graph: &mut Graph, dense: &Dense, out: &str, x: &str) -> String {
    let Dense { name, inputs, outputs, .. } = dense;
    let weight = graph.reals(&format!("{name}.weight"), &[*outputs, *inputs], &dense.weight);
    let bias = graph.reals(&format!("{name}.bias"), &[*outputs], &dense.bias);
    graph.add("Gemm", out, &[x, &weight, &bias], vec![int("transB", 1)])
}

fn relu(graph: &mut Graph, dense: &Dense, y: String) -> String {
    if dense.relu { graph.add("Relu", &format!("{y}.relu"), &[&y], vec![]) } else { y }
}

/// The maximum of each feature, `[batch, features]`.
pub fn pool(graph: &mut Graph, name: &str, x: &str) -> String {
    let axes = graph.whole(&[2]);
    graph.add("ReduceMax", name, &[x, &axes], vec![int("keepdims", 0)])
}

/// The last two axes exchanged.
pub fn transposed(graph: &mut Graph, name: &str, x: &str) -> String {
    graph.add("Transpose", name, &[x], vec![ints("perm", &[0, 2, 1])])
}
