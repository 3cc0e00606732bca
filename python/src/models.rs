//! Model files for Python's importers and exporters: their layers, and how they are written.

use crate::error::raised;
use formats::labelled::read_labelled;
use formats::model_card::ModelCard;
use formats::weights::{self, Tensor};
use infer_cpu::model_file::{self, Dense, TNet};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::Path;

/// The keys and values of a card.
type Metadata = BTreeMap<String, String>;

/// A layer: its name, W, `[outputs, inputs]`, b, `[outputs]`, and whether a ReLU follows.
type Layer<'py> = (String, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<f32>>, bool);

/// The card of the bundled model of this name, or of the model file at this path, and its layers,
/// batch norms folded in.
#[pyfunction]
pub fn read_network<'py>(py: Python<'py>, model: &str) -> PyResult<(Metadata, Bound<'py, PyDict>)> {
    let read = py.detach(|| model_file::read(Path::new(model)));
    let (card, network) = read.map_err(raised)?;
    let layer = |dense: Dense| layer(py, dense);
    let layers = |all: Vec<Dense>| all.into_iter().map(layer).collect::<PyResult<Vec<_>>>();
    let t_net =
        |net: TNet<Dense, Dense>| Ok::<_, PyErr>((net.k, layers(net.convs)?, layers(net.fcs)?));
    let edges = network.edges.into_iter().map(|(radius, dense)| Ok((radius, layer(dense)?)));
    let levels = network
        .abstractions
        .into_iter()
        .map(|level| Ok((level.centres, level.radius, layer(level.pool)?, layers(level.convs)?)));
    let parts = PyDict::new(py);
    parts.set_item("stn", network.stn.map(t_net).transpose()?)?;
    parts.set_item("fstn", network.fstn.map(t_net).transpose()?)?;
    parts.set_item("transform_after", network.transform_after)?;
    parts.set_item("edges", edges.collect::<PyResult<Vec<_>>>()?)?;
    parts.set_item("trunk", layers(network.trunk)?)?;
    parts.set_item("abstractions", levels.collect::<PyResult<Vec<_>>>()?)?;
    parts.set_item("head", layers(network.head)?)?;
    parts.set_item("front", network.front.map(layers).transpose()?)?;
    Ok((card.to_metadata(), parts))
}

fn layer(py: Python<'_>, dense: Dense) -> PyResult<Layer<'_>> {
    let weight = Array2::from_shape_vec((dense.outputs, dense.inputs), dense.weight);
    let weight = weight.map_err(raised)?.into_pyarray(py);
    Ok((dense.name, weight, dense.bias.into_pyarray(py), dense.relu))
}

/// Writes a model file of f32, or of f16 if `is_half`.
#[pyfunction]
pub fn write_weights(
    path: &str,
    tensors: BTreeMap<String, PyReadonlyArrayDyn<'_, f32>>,
    metadata: Metadata,
    is_half: bool,
) -> PyResult<()> {
    let tensor = |values: &PyReadonlyArrayDyn<'_, f32>| Tensor {
        shape: values.shape().to_vec(),
        values: values.as_array().iter().copied().collect(),
    };
    let tensors = tensors.iter().map(|(name, values)| (name.clone(), tensor(values))).collect();
    let write = if is_half { weights::write_half_weights } else { weights::write_weights };
    write(Path::new(path), &tensors, &metadata).map_err(raised)
}

/// The largest activations of a model on a packed NPZ file of clouds, as the card states them.
#[pyfunction]
pub fn activation_ranges(py: Python<'_>, model: &str, clouds: &str) -> PyResult<String> {
    let measured = py.detach(|| {
        let set = read_labelled(Path::new(clouds)).map_err(raised)?;
        infer_cpu::activation_ranges_of_set(Path::new(model), &set).map_err(raised)
    });
    let card = ModelCard { activation_ranges: measured?, ..ModelCard::default() };
    let ranges = card.to_metadata().remove("activation_ranges");
    ranges.ok_or_else(|| raised(format!("{model}: expected layers to calibrate, found none")))
}
