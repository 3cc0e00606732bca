use std::collections::BTreeSet;

use infer_cpu::model_file::{Dense, SetAbstraction};

use super::proto::{GraphProto, TensorProto};
use super::*;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn bundled(name: &str) -> PathBuf {
    root().join("assets/weights").join(name).with_extension("safetensors")
}

/// Bundled models, and narrow ones: `tiny` with batch norms and T-Nets.
fn models() -> Vec<PathBuf> {
    let wide = ["untrained-test", "shapes-rotational-64", "edge-64", "cpl-64"];
    let narrow = root().join("infer-cpu/tests/golden");
    let mut models = wide.map(bundled).to_vec();
    models.extend(["tiny", "plain"].map(|name| narrow.join(name).with_extension("safetensors")));
    models
}

fn exported(path: &Path, n_points: Option<usize>) -> ModelProto {
    let (card, net) = model_file::read(path).unwrap();
    export(&net, &card, n_points).unwrap()
}

/// A network of two set abstractions.
fn sets() -> (ModelCard, Net) {
    let (card, mut net) = model_file::read(&bundled("shapes-rotational-64")).unwrap();
    let layer = |name: &str, inputs: usize, outputs: usize| {
        let (weight, bias) = (vec![0.5; inputs * outputs], vec![0.0; outputs]);
        Dense { name: name.to_owned(), inputs, outputs, weight, bias, relu: true }
    };
    let level = |name: &str, width: usize, centres: usize| SetAbstraction {
        centres,
        radius: 0.3,
        pool: layer(&format!("{name}.conv1"), 4, width),
        convs: vec![layer(&format!("{name}.conv2"), width, 8)],
    };
    let width = net.trunk.last().unwrap().outputs;
    net.abstractions = vec![level("sa1", width, 16), level("sa2", 8, 4)];
    (card, net)
}

fn graph_of(path: &Path, n_points: Option<usize>) -> GraphProto {
    exported(path, n_points).graph.unwrap()
}

fn graph_of_sets() -> GraphProto {
    let (card, net) = sets();
    export(&net, &card, None).unwrap().graph.unwrap()
}

fn constant<'a>(graph: &'a GraphProto, name: &str) -> &'a TensorProto {
    graph.initializer.iter().find(|tensor| tensor.name == name).unwrap()
}

/// ONNX's rules for a graph (IR.md, "Names within a graph" and "Nodes").
#[test]
fn every_value_is_made_once_before_it_is_used_and_every_constant_is_used() {
    let graphs = models().into_iter().flat_map(|path| {
        [None, Some(16)].map(|n_points| (path.display().to_string(), graph_of(&path, n_points)))
    });
    for (name, graph) in graphs.chain([("set abstractions".to_owned(), graph_of_sets())]) {
        let inputs = graph.input.iter().map(|value| value.name.as_str());
        let constants = graph.initializer.iter().map(|tensor| tensor.name.as_str());
        let mut known: BTreeSet<&str> = inputs.chain(constants).collect();
        assert_eq!(known.len(), graph.input.len() + graph.initializer.len());
        let mut used = BTreeSet::new();
        for node in &graph.node {
            for input in &node.input {
                assert!(known.contains(input.as_str()), "{name}: {input}");
                used.insert(input.as_str());
            }
            for output in &node.output {
                assert!(known.insert(output), "{name}: {output} is made twice");
            }
        }
        assert!(graph.output.iter().all(|value| known.contains(value.name.as_str())));
        for tensor in &graph.initializer {
            assert!(used.contains(tensor.name.as_str()), "{} is idle", tensor.name);
            let size = if tensor.data_type == data_type::FLOAT { 4 } else { 8 };
            let count = tensor.dims.iter().product::<i64>() as usize;
            assert_eq!(tensor.raw_data.len(), count * size, "{}", tensor.name);
        }
    }
}

#[test]
fn weights_bear_pytorch_s_names_and_shapes_and_hold_the_norms() {
    let graph = graph_of(&bundled("untrained-test"), None);
    for (name, shape) in [
        ("feat.conv1.weight", &[8, 3, 1][..]),
        ("feat.stn.conv3.weight", &[64, 16, 1]),
        ("feat.fstn.fc3.weight", &[64, 16]),
        ("fc3.bias", &[4]),
    ] {
        assert_eq!(constant(&graph, name).dims, shape, "{name}");
    }
    let tiny = root().join("infer-cpu/tests/golden/tiny.safetensors");
    let (_, net) = model_file::read(&tiny).unwrap();
    let bias: Vec<u8> = net.trunk[0].bias.iter().flat_map(|value| value.to_le_bytes()).collect();
    let graph = graph_of(&tiny, None);
    assert_eq!(constant(&graph, "feat.conv1.bias").raw_data, bias);
    assert!(graph.initializer.iter().all(|tensor| !tensor.name.contains("bn")));
}

#[test]
fn inputs_and_outputs_are_what_the_network_looks_at() {
    let names_of = |graph: GraphProto| {
        let names = |values: Vec<proto::ValueInfoProto>| {
            values.into_iter().map(|value| value.name).collect::<Vec<_>>().join(" ")
        };
        (names(graph.input), names(graph.output))
    };
    let names = |name: &str, n_points| names_of(graph_of(&bundled(name), n_points));
    let is = |inputs: &str, outputs: &str| (inputs.to_owned(), outputs.to_owned());
    assert_eq!(names("shapes-rotational-64", None), is("points", "logits"));
    assert_eq!(names("edge-64", None), is("points cloud", "logits"));
    assert_eq!(names("edge-64", Some(64)), is("cloud", "logits kept"));
    assert_eq!(names_of(graph_of_sets()), is("points centres", "logits"));
}

#[test]
fn the_file_states_its_opset_and_the_model_s_card() {
    let model = exported(&bundled("cpl-64"), Some(64));
    let read = ModelProto::decode(&model.encode_to_vec()[..]).unwrap();
    assert_eq!(read, model);
    assert_eq!((read.ir_version, read.opset_import[0].version), (8, 18));
    let remark = |key: &str| {
        read.metadata_props.iter().find(|entry| entry.key == key).map(|entry| entry.value.as_str())
    };
    assert_eq!(remark("normalization"), Some("unit-sphere"));
    assert_eq!(remark("points"), Some("64"));
}

#[test]
fn what_onnx_cannot_choose_by_is_refused() {
    let (card, mut net) = model_file::read(&bundled("untrained-test")).unwrap();
    let refused = |net: &Net| export(net, &card, Some(16)).unwrap_err().to_string();
    (net.front, net.stn) = (None, None);
    assert!(refused(&net).contains("neither a front end"), "{}", refused(&net));
    let (_, net) = sets();
    assert!(refused(&net).contains("set abstractions"), "{}", refused(&net));
}

#[test]
fn the_default_model_is_exported_without_a_file() {
    let (card, built_in) = model_file::read(Path::new("edge-64")).unwrap();
    let (_, from_file) = model_file::read(&bundled("edge-64")).unwrap();
    let export = |net| export(net, &card, None).unwrap().encode_to_vec();
    assert!(export(&built_in) == export(&from_file));
}
