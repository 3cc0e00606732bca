//! Weights in the order of the kernels' accesses.

use std::ops::Range;

use crate::{GEMV_NR, WIDTH_STEP};

/// The weights of a layer, in panels of `nr` output channels.
///
/// Within a panel, inputs form groups of `group` (1, or 4 for int8, whose instructions process four
/// inputs at once): element (input k, channel o) is at `((panel * padded_inputs / group + k /
/// group) * nr + o % nr) * group + k % group`.
///
/// # Invariant
/// Unsafe kernels rely on these lengths. All fields but `relu` are private, [`Panels::zeros`]
/// establishes them, and only [`Panels::scales_mut`] changes the length of a vector, from 0 to the
/// full length.
///
/// - `padded_outputs`, the length of `bias`, is a multiple of [`WIDTH_STEP`] and therefore of `nr`.
/// - `data` has `padded_inputs * padded_outputs` elements.
/// - `scale` is empty or has `padded_outputs` elements.
/// - `padded_inputs` is a multiple of the `k_step` of construction and of `group`.
#[derive(Clone, Debug, PartialEq)]
pub struct Panels<W> {
    inputs: usize,
    padded_inputs: usize,
    outputs: usize,
    nr: usize,
    group: usize,
    data: Vec<W>,
    scale: Vec<f32>,
    bias: Vec<f32>,
    /// Whether negative outputs become 0.
    pub relu: bool,
}

impl<W: Copy + Default> Panels<W> {
    /// Panels of zeros, with `nr` channels each, and inputs that are padded to a multiple of
    /// `k_step` and form groups of `group`.
    ///
    /// # Panics
    /// If `nr` does not divide [`WIDTH_STEP`], if `group` does not divide `k_step`, or if the
    /// weights would not fit in memory.
    pub fn zeros(
        inputs: usize,
        outputs: usize,
        (nr, k_step, group): (usize, usize, usize),
    ) -> Self {
        assert!(
            nr > 0 && WIDTH_STEP.is_multiple_of(nr),
            "expected panels that divide {WIDTH_STEP} channels, found {nr}"
        );
        assert!(
            group > 0 && k_step > 0 && k_step.is_multiple_of(group),
            "expected a k step of whole groups of {group}, found {k_step}"
        );
        // At least one input, so that a panel is never empty.
        let padded_inputs = padded(inputs.max(1), k_step);
        let padded_outputs = padded(outputs, WIDTH_STEP);
        Self {
            inputs,
            padded_inputs,
            outputs,
            nr,
            group,
            data: vec![W::default(); product(padded_inputs, padded_outputs)],
            scale: Vec::new(),
            bias: vec![0.0; padded_outputs],
            relu: false,
        }
    }

    /// Panels of zeros for matrix-vector products, [`crate::Gemv`].
    pub fn columns(inputs: usize, outputs: usize) -> Self {
        Self::zeros(inputs, outputs, (GEMV_NR, 1, 1))
    }

    /// Inputs of the layer.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Inputs of the layer, padded with zeros to the kernel's step.
    pub fn padded_inputs(&self) -> usize {
        self.padded_inputs
    }

    /// Outputs of the layer.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Output channels of a panel.
    pub fn nr(&self) -> usize {
        self.nr
    }

    /// The number of weights, padding included.
    pub fn n_weights(&self) -> usize {
        self.data.len()
    }

    /// The factor of the accumulator of each padded output; empty if all are 1.
    pub fn scales(&self) -> &[f32] {
        &self.scale
    }

    /// The scales for writing: one for each padded output, initially 1.
    pub fn scales_mut(&mut self) -> &mut [f32] {
        // All scales or none: kernels read whole vectors of them.
        self.scale.resize(self.bias.len(), 1.0);
        &mut self.scale
    }

    /// The summand of the scaled accumulator of each padded output.
    pub fn biases(&self) -> &[f32] {
        &self.bias
    }

    /// The biases for writing: one for each padded output, initially 0.
    pub fn biases_mut(&mut self) -> &mut [f32] {
        &mut self.bias
    }

    fn index(&self, input: usize, output: usize) -> usize {
        let Self { nr, group, padded_inputs, .. } = self;
        let row = output / nr * (padded_inputs / group) + input / group;
        (row * nr + output % nr) * group + input % group
    }

    /// The weight of `input` for `output`.
    pub fn weight(&self, input: usize, output: usize) -> W {
        self.data[self.index(input, output)]
    }

    /// Sets the weight of `input` for `output`.
    pub fn set(&mut self, input: usize, output: usize, weight: W) {
        let at = self.index(input, output);
        self.data[at] = weight;
    }

    /// Sets every weight to `weight(input, output)`.
    pub fn fill(&mut self, weight: impl Fn(usize, usize) -> W) {
        for output in 0..self.outputs {
            for input in 0..self.inputs {
                self.set(input, output, weight(input, output));
            }
        }
    }

    /// The number of panels.
    pub fn n_panels(&self) -> usize {
        self.padded_outputs() / self.nr
    }

    /// Output channels, padding included.
    pub fn padded_outputs(&self) -> usize {
        self.bias.len()
    }

    /// The weights of a panel.
    pub fn panel(&self, panel: usize) -> &[W] {
        let size = self.padded_inputs * self.nr;
        &self.data[panel * size..][..size]
    }

    /// The output channels of a range of panels.
    pub fn channels(&self, panels: &Range<usize>) -> Range<usize> {
        panels.start * self.nr..panels.end * self.nr
    }
}

fn padded(n: usize, step: usize) -> usize {
    // Widths come from a file, so that they may be of any size.
    n.checked_next_multiple_of(step).expect("a layer's widths fit in memory")
}

fn product(a: usize, b: usize) -> usize {
    a.checked_mul(b).expect("a layer's weights fit in memory")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::panics_with;

    #[test]
    fn sizes_beyond_memory_are_refused() {
        let many = usize::MAX / WIDTH_STEP + 2;
        panics_with("fit in memory", || Panels::<f32>::zeros(many, WIDTH_STEP, (8, 1, 1)));
        panics_with("fit in memory", || Panels::<f32>::columns(1, usize::MAX));
    }

    #[test]
    fn panels_of_unsupported_sizes_are_refused() {
        panics_with("found 24", || Panels::<f32>::zeros(1, 1, (24, 1, 1)));
        panics_with("found 6", || Panels::<i8>::zeros(1, 1, (8, 6, 4)));
    }

    #[test]
    fn scales_are_whole_once_one_is_set() {
        let mut panels = Panels::<i8>::zeros(5, 70, (8, 4, 4));
        assert!(panels.scales().is_empty());
        panels.scales_mut()[69] = 2.0;
        assert_eq!(panels.scales().len(), panels.padded_outputs());
        assert_eq!((panels.scales()[0], panels.scales()[69]), (1.0, 2.0));
    }
}
