//! `infer-cpu inspect`: shows the content of a model file.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::sampler::SamplerSpec;
use crate::{LayerShape, ModelCard, NetShape, Precision, Summary};
use serde_json::{Value, json};

use super::Outcome;
use super::model;

/// Flags of `inspect`.
#[derive(clap::Args)]
#[command(after_help = include_str!("inspect.txt"))]
pub struct InspectArgs {
    /// Model file, or the name of a bundled model [default: $EDGEPUCK_MODEL, else edge-64]
    model: Option<PathBuf>,

    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

pub fn run(args: &InspectArgs) -> anyhow::Result<Outcome> {
    let path = model::find(args.model.as_deref());
    let summary = crate::inspect(&path)?;
    let sampler = SamplerSpec::as_trained(&path, &summary.card)?;
    let text = match args.json {
        true => format!("{}\n", as_json(&path, &summary, &sampler)),
        false => as_text(&path, &summary, &sampler)?,
    };
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()?;
    Ok(Outcome::Success)
}

fn as_json(path: &Path, summary: &Summary, sampler: &SamplerSpec) -> Value {
    let card = &summary.card;
    let layer = |layer: &LayerShape| json!({ "name": layer.name, "inputs": layer.inputs, "outputs": layer.outputs });
    let layers = |layers: &[LayerShape]| layers.iter().map(layer).collect::<Value>();
    let net = |net: &NetShape| json!({ "convs": layers(&net.convs), "fcs": layers(&net.fcs) });
    let front = summary.front.as_ref().map(|convs| json!({ "convs": layers(convs) }));
    let bytes: serde_json::Map<_, _> = Precision::ALL
        .iter()
        .map(|&precision| (precision.name().to_owned(), summary.bytes(precision).into()))
        .collect();
    json!({
        "file": path.to_string_lossy(),
        "n_classes": summary.n_classes(),
        "classes": card.classes,
        "trained": card.trained,
        "training_set": card.training_set,
        "accuracy": card.accuracy,
        "provenance": card.provenance,
        "normalization": card.normalization.name(),
        "unknown_classes": card.unknown_classes,
        "temperature": card.temperature,
        "sampler": sampler.kind.name(),
        "points": card.points,
        "fps_start": sampler.fps_start.name(),
        "int8_calibrated": !card.activation_ranges.is_empty(),
        "input_t_net": summary.stn.as_ref().map(net),
        "feature_t_net": summary.fstn.as_ref().map(net),
        "transform_after": card.transform_after,
        "edges": summary.edges.iter().map(|(radius, layer)| json!({
            "name": layer.name,
            "radius": radius,
            "channels": layer.outputs,
        })).collect::<Vec<_>>(),
        "abstractions": summary.abstractions.iter().zip(&card.abstractions).map(
            |((centres, convs), (_, radius))| json!({
                "centres": centres,
                "radius": radius,
                "layers": layers(convs),
            })
        ).collect::<Vec<_>>(),
        "trunk": layers(&summary.trunk.convs),
        "pooled": if card.pooled_relu { "relu" } else { "linear" },
        "head": layers(&summary.trunk.fcs),
        "front": front,
        "stored": summary.n_stored,
        "parameters": summary.parameters(),
        "macs_per_point": summary.macs_per_point(),
        "macs_per_cloud": summary.macs_per_cloud(),
        "front_macs_per_point": summary.front_macs_per_point(),
        "bytes": bytes,
    })
}

fn as_text(
    path: &Path,
    summary: &Summary,
    sampler: &SamplerSpec,
) -> Result<String, std::fmt::Error> {
    let card = &summary.card;
    let mut text = String::new();
    let mut row = |name: &str, value: String| writeln!(text, "{name:<16}{value}");
    row("file", path.display().to_string())?;
    row("trained", if card.trained { "yes" } else { "no: random weights" }.to_owned())?;
    let remarks = [
        ("training set", &card.training_set),
        ("accuracy", &card.accuracy),
        ("provenance", &card.provenance),
    ];
    for (name, remark) in remarks {
        if let Some(remark) = remark {
            row(name, remark.clone())?;
        }
    }
    row("classes", classes(summary))?;
    if let Some(unknown) = unknown(card) {
        row("unknown", unknown)?;
    }
    row("normalization", card.normalization.name().to_owned())?;
    let points = card.points.map_or(String::new(), |points| format!(", {points} points"));
    row("sampler", format!("{}{points}", sampler.kind))?;
    row("input T-Net", net(summary.stn.as_ref()))?;
    let feature = net(summary.fstn.as_ref());
    match summary.fstn {
        Some(_) => row("feature T-Net", format!("{feature}, after conv{}", card.transform_after))?,
        None => row("feature T-Net", feature)?,
    }
    if !summary.edges.is_empty() {
        let edges = summary.edges.iter();
        let edges = edges.map(|(radius, layer)| format!("{} within {radius}", layer.outputs));
        row("surroundings", edges.collect::<Vec<_>>().join(", "))?;
    }
    if summary.abstractions.is_empty() {
        let pooled = if card.pooled_relu { ", ReLU" } else { "" };
        row("trunk", format!("{}{pooled}, max", chain(&summary.trunk.convs)))?;
    } else {
        row("trunk", chain(&summary.trunk.convs))?;
    }
    for ((centres, layers), (_, radius)) in summary.abstractions.iter().zip(&card.abstractions) {
        row("abstraction", format!("{centres} centres within {radius}, {}", chain(&layers[1..])))?;
    }
    row("head", chain(&summary.trunk.fcs))?;
    row(
        "front end",
        match &summary.front {
            None => "none of its own".to_owned(),
            Some(layers) => format!("{}, max", chain(layers)),
        },
    )?;
    row("parameters", format!("{} ({} stored)", summary.parameters(), summary.n_stored))?;
    row("MACs", macs(summary))?;
    let bytes = Precision::ALL.map(|precision| format!("{precision} {}", summary.bytes(precision)));
    row("bytes", bytes.join(", "))?;
    row(
        "int8",
        match card.activation_ranges.len() {
            0 => "not calibrated: loading uses generated shapes".to_owned(),
            n => format!("calibrated, {n} layers"),
        },
    )?;
    Ok(text)
}

fn classes(summary: &Summary) -> String {
    match summary.card.classes.join(", ") {
        names if names.is_empty() => format!("{}, without names", summary.n_classes()),
        names => format!("{}: {names}", summary.n_classes()),
    }
}

/// The classes that count as unknown, if there are any.
fn unknown(card: &ModelCard) -> Option<String> {
    (!card.unknown_classes.is_empty()).then(|| card.unknown_classes.join(", "))
}

fn macs(summary: &Summary) -> String {
    let front = summary.front_macs_per_point();
    let front = front.map_or(String::new(), |n| format!(", front end {n} a point"));
    format!("{} a point + {} a cloud{front}", summary.macs_per_point(), summary.macs_per_cloud())
}

fn net(net: Option<&NetShape>) -> String {
    net.map_or("none".to_owned(), |net| format!("{}, max, {}", chain(&net.convs), chain(&net.fcs)))
}

/// The widths of the layers: `3-64-128-1024`.
fn chain(layers: &[LayerShape]) -> String {
    let first = layers.first().map(|layer| layer.inputs);
    let widths = first.into_iter().chain(layers.iter().map(|layer| layer.outputs));
    widths.map(|width| width.to_string()).collect::<Vec<_>>().join("-")
}
