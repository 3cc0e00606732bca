//! The layers of the network in a model file, packed for the kernels of one precision.

use std::collections::BTreeMap;

use edgepuck_kernels::{Dense, Format, Kernels, Panels, Weight};
use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{WeightsFile, tensor_part};

use super::image::CHANNELS;
use super::plan::{HEAD, OUTPUTS, Of, STEPS};
use crate::model::layers::panels;

/// The layer of a step.
pub enum Layer<T: Format> {
    /// On the channels of the image, in f32: biases, and for each channel its weights.
    Image { bias: Vec<f32>, weights: Vec<f32> },
    /// Its inputs are those of all cells under the kernel, row by row.
    Conv(Panels<T::Weight>),
    /// Sums have no weights.
    Sum,
}

/// The layer of each step with the number of its outputs, and its largest output.
pub struct Layers<T: Format> {
    pub of: Vec<Layer<T>>,
    pub widths: Vec<usize>,
    pub ranges: Vec<f32>,
}

impl<T: Format> Layers<T> {
    /// Reads and packs the layers of `file`, with the largest outputs that `card` states.
    ///
    /// # Errors
    /// A tensor that is missing, of another shape or unknown; no largest outputs.
    pub fn read(
        file: &mut WeightsFile,
        card: &ModelCard,
        kernels: &Kernels,
    ) -> Result<Self, FormatError> {
        let mut left = file.shapes();
        let mut layers = Self { of: Vec::new(), widths: Vec::new(), ranges: Vec::new() };
        for (step, number) in STEPS.iter().zip(0..) {
            let Self { of, widths, ranges } = &mut layers;
            let (layer, width) = match step.of {
                Of::Image => {
                    let dense = read(file, &mut left, step.name, CHANNELS, 1)?;
                    let weights = (0..dense.inputs * dense.outputs)
                        .map(|at| dense.at(at / dense.outputs, at % dense.outputs))
                        .collect();
                    (Layer::Image { bias: dense.bias, weights }, dense.outputs)
                }
                Of::Sum { whole, half } => {
                    let [expected, found] = [whole, half].map(|step| widths[step]);
                    if expected != found {
                        let cause = format!("expected {expected} outputs, found {found}");
                        return Err(error(file, STEPS[half].name, cause));
                    }
                    (Layer::Sum, expected)
                }
                Of::Conv { from, size, .. } => {
                    let dense = read(file, &mut left, step.name, widths[from], size)?;
                    let mut packed = panels::<T>(kernels, dense.inputs, dense.outputs);
                    packed.biases_mut()[..dense.outputs].copy_from_slice(&dense.bias);
                    packed.relu = number != HEAD;
                    T::Weight::fill(&mut packed, ranges[from], |input, output| {
                        dense.at(input, output)
                    });
                    (Layer::Conv(packed), dense.outputs)
                }
            };
            if number == HEAD && width != OUTPUTS {
                let cause = format!("expected {OUTPUTS} outputs, found {width}");
                return Err(error(file, step.name, cause));
            }
            of.push(layer);
            widths.push(width);
            let range = card.activation_ranges.get(step.name).copied();
            let range = range.filter(|range| range.is_normal() && *range > 0.0);
            let missing = || error(file, step.name, "no range in `activation_ranges`".to_owned());
            ranges.push(if number == HEAD { 1.0 } else { range.ok_or_else(missing)? });
        }
        match left.into_iter().next() {
            None => Ok(layers),
            Some((name, shape)) => {
                let cause =
                    format!("unexpected: no layer takes a tensor of this name (shape {shape:?})");
                Err(FormatError::malformed(file.path(), tensor_part(&name), cause))
            }
        }
    }
}

/// The most outputs of a layer: the results of all cells are kept, and sums of int8 products fit 32 bits.
const WIDEST: usize = 512;

/// Reads a layer of `inputs` channels and a square kernel of `size` cells, and takes its tensors from
/// those that are `left`.
fn read(
    file: &mut WeightsFile,
    left: &mut BTreeMap<String, Vec<usize>>,
    name: &str,
    inputs: usize,
    size: usize,
) -> Result<Dense, FormatError> {
    let [weight_name, bias_name] = ["weight", "bias"].map(|part| format!("{name}.{part}"));
    let (weight, bias) = (file.read(&weight_name)?, file.read(&bias_name)?);
    left.remove(&weight_name);
    left.remove(&bias_name);
    let outputs = weight.shape.first().copied().unwrap_or(0);
    let is_layer = weight.shape == [outputs, inputs, size, size] && bias.shape == [outputs];
    if !is_layer || !(1..=WIDEST).contains(&outputs) {
        let cause = format!(
            "expected shapes [n, {inputs}, {size}, {size}] and [n], n up to {WIDEST}, found {:?} and {:?}",
            weight.shape, bias.shape
        );
        return Err(error(file, name, cause));
    }
    let area = size * size;
    // From [output, channel, cell] to [output, cell, channel]: a row of the image has its channels
    // side by side.
    let ordered = (0..outputs * area * inputs).map(|at| {
        let (output, cell, channel) = (at / (area * inputs), at / inputs % area, at % inputs);
        weight.values[(output * inputs + channel) * area + cell]
    });
    let (name, weight) = (name.to_owned(), ordered.collect());
    let mut dense =
        Dense { name, inputs: area * inputs, outputs, weight, bias: bias.values, relu: true };
    dense.flush();
    Ok(dense)
}

fn error(file: &WeightsFile, layer: &str, cause: String) -> FormatError {
    FormatError::malformed(file.path(), format!("layer `{layer}`"), cause)
}
