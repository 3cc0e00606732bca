mod critical_points;
mod edges;
mod graph;
mod layers;
mod pointnet;
mod proto;
mod set_abstractions;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use formats::atomic;
use formats::model_card::ModelCard;
use infer_cpu::model_file;
use prost::Message;

use crate::{Outcome, Usage};
use formats::outputs::{Overwrite, need_extension};
use graph::{Graph, Size};
use pointnet::{Net, NetInputs};
use proto::{ModelProto, OperatorSetIdProto, StringStringEntryProto, data_type};

/// The operators are those of ONNX 1.13, the first version in which ReduceMax takes its axes as an
/// input. ONNX Runtime 1.14 and later run them.
const OPSET: i64 = 18;

/// The version of the messages that came with [`OPSET`].
const IR_VERSION: i64 = 8;

/// The largest message of protobuf, in bytes.
const LARGEST: usize = i32::MAX as usize;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  edgepuck export-onnx edge-64 --out edge-64.onnx
  edgepuck export-onnx cpl-64.safetensors --critical-points --out cpl-64.onnx

Opset 18, IR version 8, f32. Batch norms are folded into weights. Weights are
named as in PyTorch's checkpoints (feat.conv1.weight).

Inputs in f32. Normalise them as the model's card says (unit-sphere: subtract the
mean, and divide by the largest radius); infer-cpu does this, the graph does not:
  points [batch, points, 3]  points that the network sees, chosen by any sampler
  cloud  [batch, all, 3]     all points, for networks with EdgeConv features
  centres [batch, centres, 3]  for networks of set abstractions: the farthest of
                             `points` in their order, from the one farthest from the
                             mean, as `infer-cpu sample --sampler fps` chooses them
With --critical-points, `cloud` is the only input, and the graph selects the points.
EdgeConv needs memory for points x all x 64 channels x 4 bytes: 16 MB for 64 of
1,024 points. Set abstractions need it for centres x points x channels x 4 bytes:
64 MB for 256 centres, 1,024 points and 64 channels.
Outputs:
  logits [batch, classes]    before the softmax, as in the output of infer-cpu --json
  kept   [batch, M], int64   with --critical-points: indices of the chosen points

The card (classes, normalization, sampler, ...) is in the file's metadata_props.")]
pub struct ExportOnnxArgs {
    /// Model file, or the name of a bundled model: edge-64, set-64, street-128 or
    /// shapes-rotational-64
    #[arg(value_name = "MODEL")]
    model: PathBuf,

    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    overwrite: Overwrite,

    /// Include the model's Critical Points Layer in the graph, like infer-cpu's --sampler cpl
    #[arg(long)]
    critical_points: bool,

    /// Number of points that the Critical Points Layer keeps [default: as in training]
    #[arg(long, value_name = "M", requires = "critical_points")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    points: Option<u32>,
}

pub fn run(args: &ExportOnnxArgs) -> anyhow::Result<Outcome> {
    need_extension("--out", &args.out, &["onnx"])?;
    args.overwrite.check([&*args.out])?;
    let path = &args.model;
    let (card, net) = model_file::read(path)?;
    let n_points = args.critical_points.then(|| kept_points(args, path, &card)).transpose()?;
    let here = || format!("{} cannot be exported", path.display());
    let model = export(&net, &card, n_points).with_context(here)?;
    let size = model.encoded_len();
    if size > LARGEST {
        bail!("{}: an ONNX file holds 2 GiB at most, this one needs {size} bytes", here());
    }
    atomic::write_bytes(&args.out, model.encode_to_vec())?;
    let graph = model.graph.as_ref().context("invariant: a model has a graph")?;
    let names = |values: &[proto::ValueInfoProto]| {
        values.iter().map(|value| value.name.clone()).collect::<Vec<_>>().join(", ")
    };
    let (from, to) = (names(&graph.input), names(&graph.output));
    formats::say!("{}: {from} -> {to}, opset {OPSET}, {size} bytes", args.out.display());
    Ok(Outcome::Success)
}

fn kept_points(args: &ExportOnnxArgs, path: &Path, card: &ModelCard) -> anyhow::Result<usize> {
    let trained = card.points.and_then(|points| u32::try_from(points).ok());
    match args.points.or(trained) {
        Some(points) if points > 0 => Ok(points as usize),
        _ => Err(Usage(format!(
            "{} does not state its number of points: give --points",
            path.display()
        ))
        .into()),
    }
}

/// The ONNX model of `net`, with a Critical Points Layer of `n_points` points before it if given.
fn export(net: &Net, card: &ModelCard, n_points: Option<usize>) -> anyhow::Result<ModelProto> {
    const BATCH: Size<'_> = Size::Named("batch");
    let mut graph = Graph::default();
    let mut input = |name, n| graph.input(name, &[BATCH, Size::Named(n), Size::Fixed(3)]);
    let inputs = match n_points {
        Some(n_points) => {
            let cloud = input("cloud", "all");
            critical_points::add(&mut graph, net, &cloud, n_points)?
        }
        None => {
            let points = input("points", "points");
            let cloud = (!net.edges.is_empty()).then(|| input("cloud", "all"));
            let centres = (!net.abstractions.is_empty()).then(|| input("centres", "centres"));
            NetInputs { points, cloud, centres, pooled_stn: None }
        }
    };
    pointnet::add(&mut graph, net, &inputs);
    let n_classes = net.head.last().map_or(0, |layer| layer.outputs);
    graph.output("logits", data_type::FLOAT, &[BATCH, Size::Fixed(n_classes)]);
    if n_points.is_some() {
        graph.output(critical_points::KEPT, data_type::INT64, &[BATCH, Size::Named("kept")]);
    }
    Ok(ModelProto {
        ir_version: IR_VERSION,
        producer_name: "edgepuck".to_owned(),
        producer_version: env!("CARGO_PKG_VERSION").to_owned(),
        doc_string: "PointNet: logits of clouds that are normalised as metadata `normalization` \
                     says"
            .to_owned(),
        graph: Some(graph.finish("pointnet")),
        opset_import: vec![OperatorSetIdProto { domain: String::new(), version: OPSET }],
        metadata_props: card
            .to_metadata()
            .into_iter()
            .map(|(key, value)| StringStringEntryProto { key, value })
            .collect(),
    })
}
