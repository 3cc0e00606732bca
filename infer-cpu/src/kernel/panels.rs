//! Weights in the order in which kernels read them.

use std::ops::Range;

use super::WIDTH_STEP;

/// A layer's weights for matrix products: panels of `nr` output channels.
///
/// Within a panel, inputs go in groups of `group` (1, or 4 for int8, whose
/// instructions take four inputs at once): element (input k, channel o) is at
/// `((panel * padded_inputs / group + k / group) * nr + o % nr) * group + k % group`.
#[derive(Clone, Debug, PartialEq)]
pub struct Panels<W> {
    /// Inputs of the layer.
    pub inputs: usize,
    /// Inputs with zeros up to the kernel's step.
    pub padded_inputs: usize,
    /// Output channels of the layer.
    pub outputs: usize,
    /// Output channels of a panel.
    pub nr: usize,
    /// Inputs that lie side by side.
    pub group: usize,
    /// The weights, zero where padded.
    pub data: Vec<W>,
    /// What an accumulator is multiplied by, for each padded output; empty
    /// for 1.
    pub scale: Vec<f32>,
    /// What is added then, for each padded output.
    pub bias: Vec<f32>,
    /// Whether negative outputs become 0.
    pub relu: bool,
}

impl<W: Copy + Default> Panels<W> {
    /// Panels of zeros.
    #[must_use]
    pub fn zeros(
        inputs: usize,
        outputs: usize,
        (nr, k_step, group): (usize, usize, usize),
    ) -> Self {
        let padded_inputs = inputs.next_multiple_of(k_step).max(k_step);
        let padded_outputs = outputs.next_multiple_of(WIDTH_STEP);
        Self {
            inputs,
            padded_inputs,
            outputs,
            nr,
            group,
            data: vec![W::default(); padded_inputs * padded_outputs],
            scale: Vec::new(),
            bias: vec![0.0; padded_outputs],
            relu: false,
        }
    }

    /// Where the weight of `input` for `output` is.
    #[must_use]
    pub fn index(&self, input: usize, output: usize) -> usize {
        let Self { nr, group, padded_inputs, .. } = self;
        let row = output / nr * (padded_inputs / group) + input / group;
        (row * nr + output % nr) * group + input % group
    }

    /// Sets every weight to `weight(input, output)`.
    pub fn fill(&mut self, weight: impl Fn(usize, usize) -> W) {
        for output in 0..self.outputs {
            for input in 0..self.inputs {
                let at = self.index(input, output);
                self.data[at] = weight(input, output);
            }
        }
    }

    /// How many panels there are.
    #[must_use]
    pub fn n_panels(&self) -> usize {
        self.padded_outputs() / self.nr
    }

    /// Output channels with those that are padding.
    #[must_use]
    pub fn padded_outputs(&self) -> usize {
        self.bias.len()
    }

    /// The weights of one panel.
    #[must_use]
    pub fn panel(&self, panel: usize) -> &[W] {
        let size = self.padded_inputs * self.nr;
        &self.data[panel * size..][..size]
    }

    /// The output channels of some panels.
    #[must_use]
    pub fn channels(&self, panels: &Range<usize>) -> Range<usize> {
        panels.start * self.nr..panels.end * self.nr
    }
}

/// A layer's weights for matrix-vector products: blocks of
/// [`Columns::BLOCK`] outputs, within a block input by input, so that an
/// input of 0 spares a stretch of memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns<W> {
    /// Inputs of the layer.
    pub inputs: usize,
    /// Outputs of the layer.
    pub outputs: usize,
    /// Element (input j, output o) is at
    /// `(o / BLOCK * inputs + j) * BLOCK + o % BLOCK`; zero where padded.
    pub data: Vec<W>,
    /// What a dot product is multiplied by, for each padded output; empty
    /// for 1.
    pub scale: Vec<f32>,
    /// What is added then, for each padded output.
    pub bias: Vec<f32>,
}

impl<W: Copy + Default> Columns<W> {
    /// Outputs of a block: 16 NEON accumulators of fp32.
    pub const BLOCK: usize = 64;

    /// Columns of zeros.
    #[must_use]
    pub fn zeros(inputs: usize, outputs: usize) -> Self {
        let padded = outputs.next_multiple_of(Self::BLOCK);
        Self {
            inputs,
            outputs,
            data: vec![W::default(); padded * inputs],
            scale: Vec::new(),
            bias: vec![0.0; padded],
        }
    }

    /// Sets every weight to `weight(input, output)`.
    pub fn fill(&mut self, weight: impl Fn(usize, usize) -> W) {
        for output in 0..self.outputs {
            for input in 0..self.inputs {
                let block = output / Self::BLOCK;
                self.data[(block * self.inputs + input) * Self::BLOCK + output % Self::BLOCK] =
                    weight(input, output);
            }
        }
    }

    /// How many blocks there are.
    #[must_use]
    pub fn n_blocks(&self) -> usize {
        self.bias.len() / Self::BLOCK
    }

    /// The weights of one block.
    #[must_use]
    pub fn block(&self, block: usize) -> &[W] {
        let size = self.inputs * Self::BLOCK;
        &self.data[block * size..][..size]
    }
}
