//! Exact fp32 maxima at little more than the cost of int8 products.
//!
//! Pooling needs only the largest product of each channel. The prefilter estimates every product in
//! int8, which is four times as fast, with a bound on the error: a product whose estimate lies two
//! bounds below another's cannot be the largest. The remaining products, a few in a hundred, are
//! computed in fp32. The maxima are therefore exactly those of fp32.
//!
//! For each channel, the row of a block with the largest estimate is computed first. It nearly
//! always wins, and its exact product replaces its estimate in the comparison with the others.
//!
//! # The bound
//! Activations `x >= 0` of a block of points are `s (p + d)`, levels `p` from 0 to 127; a channel's
//! weights are `w = t q + e`, `|q| <= 127`. Then
//!
//! ```text
//! sum(w x) / s  =  t sum(q p)  +  sum(e p)  +  sum(w d)
//! |sum(w x) / s - t sum(q p)|  <=  |e| |p|  +  |w| |d|
//! ```
//!
//! by Cauchy and Schwarz, with the norms |e|, |w| of the channel and the largest |p|, |d| of the
//! block's rows. Rounding in fp32 adds at most `(K + 64) u 127 sum|w|`, u = 2⁻²⁴: K + 1 steps for
//! the product that is compared with the maximum (Higham 2002, §3.1), of magnitudes of at most `127
//! sum|w|`; the other 63 for some ten steps of magnitudes of at most twice that (weights rounded
//! up): the levels' quotients, the estimate, the maximum's quotient and its sum with the bound.
//! Norms are rounded up by 10⁻⁴, more than their sums of squares lose below 10³ inputs a lane.
//! Weights and steps are limited to a range without overflow or loss of digits.

mod levels;

use std::ops::Range;

pub use levels::Levels;

use crate::format::{Format, I8, Weight};
use crate::table::{Candidate, PrefilterKernels};
use crate::{Dense, I8_LARGEST, Kernels, Panels, Rows, WIDTH_STEP};

/// Output channels that a thread pools at a time.
pub const GROUP: usize = 128;

/// Whether a prefilter makes a layer of this number of inputs faster: with few inputs, the products
/// are cheap.
#[must_use]
pub const fn prefilter_pays(inputs: usize) -> bool {
    inputs >= 32
}

/// A single product costs about three times its share of a tile. If more than one product in four
/// remains, the tile is faster.
const ONE_IN: usize = 4;

/// The range of a channel's sum of weight magnitudes. Outside of it, estimates might overflow and
/// products lose digits, so that no product is ruled out.
const ORDINARY: Range<f64> = 1e-15..1e15;

/// Norms are rounded up by more than their rounding errors in fp32.
const NORM_SLACK: f64 = 1.0001;

/// The int8 weights of a pooled layer, whose estimates rule out most of its fp32 products.
pub struct Int8Prefilter {
    channels: Vec<Channels>,
    /// `[outputs, inputs]`, inputs padded to whole vectors.
    weights: Vec<f32>,
    /// The distance from one channel's weights to the next.
    stride: usize,
}

/// Channels that are pooled together.
struct Channels {
    first: usize,
    panels: Panels<i8>,
    bounds: Vec<Bound>,
    /// In a search for winners, maxima below this do not matter.
    least: Vec<f32>,
    /// In a search for outputs of a ReLU, maxima below this do not matter.
    least_seen: Vec<f32>,
}

/// The coefficients of a channel's error bound.
#[derive(Clone, Copy, Default)]
struct Bound {
    /// |e|.
    of_levels: f32,
    /// |w|.
    of_lost: f32,
    rounding: f32,
}

/// A thread's working memory for prefiltering a block of rows.
pub struct PrefilterScratch {
    estimates: Vec<f32>,
    bounds: Vec<f32>,
    /// The largest estimate of each channel, then the threshold that other estimates must exceed.
    floors: Vec<f32>,
    peak_rows: Vec<u32>,
    found: Vec<Candidate>,
    products: Vec<f32>,
}

impl PrefilterScratch {
    /// Memory for blocks of up to this number of rows.
    pub fn new(rows: usize) -> Self {
        let channels = GROUP;
        let most = (channels + 1).max(rows * channels / ONE_IN);
        Self {
            estimates: vec![0.0; rows * channels],
            bounds: vec![0.0; channels],
            floors: vec![0.0; channels],
            peak_rows: vec![0; channels],
            found: vec![Candidate::default(); most],
            products: vec![0.0; most],
        }
    }
}

/// The best products of a group's channels so far.
pub struct Best<'a> {
    /// The largest product of each channel.
    pub maxima: &'a mut [f32],
    /// Their rows.
    pub winners: &'a mut [u32],
    /// The number of the first row of the current block.
    pub first_row: u32,
}

impl Best<'_> {
    fn raise(&mut self, candidates: &[Candidate], products: &[f32]) {
        for (candidate, &product) in candidates.iter().zip(products) {
            let channel = usize::from(candidate.channel);
            let row = self.first_row + u32::from(candidate.row);
            let best = self.maxima[channel];
            // A peak may be computed before an equal product of an earlier row.
            if product > best || (product == best && row < self.winners[channel]) {
                self.maxima[channel] = product;
                self.winners[channel] = row;
            }
        }
    }
}

impl Int8Prefilter {
    /// A prefilter for `layer`, if it makes the layer faster.
    pub fn new(layer: &Dense, kernels: &Kernels) -> Option<Self> {
        if !kernels.prefilters || !prefilter_pays(layer.inputs) {
            return None;
        }
        let groups = (0..layer.outputs).step_by(GROUP);
        let stride = layer.inputs.next_multiple_of(WIDTH_STEP);
        let mut weights = vec![0.0; layer.outputs * stride];
        for (row, from) in
            weights.chunks_exact_mut(stride).zip(layer.weight.chunks_exact(layer.inputs))
        {
            row[..layer.inputs].copy_from_slice(from);
        }
        let channels = groups
            .map(|first| Channels::new(layer, first..layer.outputs.min(first + GROUP), kernels))
            .collect();
        Some(Self { channels, weights, stride })
    }

    /// Sets the `maxima` of a group to the values below which products do not matter.
    pub fn begin(&self, group: usize, wants_winners: bool, maxima: &mut [f32]) {
        let Channels { least, least_seen, .. } = &self.channels[group];
        maxima.copy_from_slice(if wants_winners { least } else { least_seen });
    }

    /// Raises the best of a group to the products of `rows`, given their `levels`. If products are
    /// equal, the first row wins.
    ///
    /// Returns false if too many products remain; the maxima raised until then are valid.
    pub fn pool(
        &self,
        kernels: &Kernels,
        group: usize,
        (rows, levels): (&Rows<'_, f32>, &Levels),
        prefilter_scratch: &mut PrefilterScratch,
        best: &mut Best<'_>,
    ) -> bool {
        let PrefilterKernels { peaks, above_floors, dots, .. } = kernels.prefilter;
        let channels = &self.channels[group];
        let width = best.maxima.len();
        channels.estimate(kernels, rows, levels, prefilter_scratch);
        let PrefilterScratch { estimates, bounds, floors, peak_rows, found, products } =
            prefilter_scratch;
        let (estimates, bounds) = (&mut estimates[..rows.n() * width], &bounds[..width]);
        let (floors, peak_rows) = (&mut floors[..width], &mut peak_rows[..width]);
        peaks(estimates, floors, peak_rows);
        let per_step = 1.0 / levels.step;
        let mut n = 0;
        for channel in 0..width {
            // The write is unconditional and only the count depends on the comparison: this avoids
            // branch mispredictions.
            found[n] = Candidate { row: peak_rows[channel] as u16, channel: channel as u16 };
            let peak = floors[channel] + bounds[channel];
            n += usize::from(peak > best.maxima[channel] * per_step);
        }
        for peak in &found[..n] {
            // The peak is computed here; this excludes it from the search below.
            estimates[usize::from(peak.row) * width + usize::from(peak.channel)] =
                f32::NEG_INFINITY;
        }
        let weights = &self.weights[channels.first * self.stride..];
        dots(rows, weights, &found[..n], &mut products[..n]);
        best.raise(&found[..n], &products[..n]);
        for channel in 0..width {
            let floor = best.maxima[channel] * per_step - bounds[channel];
            // The difference of two infinities is NaN. An infinite bound must not rule out any
            // product.
            floors[channel] = if floor.is_nan() { f32::NEG_INFINITY } else { floor };
        }
        let most = rows.n() * width / ONE_IN;
        let Some(n) = above_floors(estimates, floors, &mut found[..most]) else { return false };
        dots(rows, weights, &found[..n], &mut products[..n]);
        best.raise(&found[..n], &products[..n]);
        true
    }
}

impl Channels {
    fn new(layer: &Dense, range: Range<usize>, kernels: &Kernels) -> Self {
        let gemm = I8::gemm(kernels).expect("invariant: kernels that prefilter have int8 products");
        let (inputs, n) = (layer.inputs, range.len());
        let mut panels = Panels::zeros(inputs, n, (gemm.nr, gemm.k_step, I8::GROUP));
        // With a range equal to the number of levels, sums are in units of levels.
        i8::fill(&mut panels, f32::from(I8_LARGEST), |input, output| {
            layer.at(input, range.start + output)
        });
        let width = panels.padded_outputs();
        // The search ignores padding: no product exceeds infinity.
        let mut channels = Self {
            first: range.start,
            bounds: vec![Bound::default(); width],
            least: vec![f32::INFINITY; width],
            least_seen: vec![f32::INFINITY; width],
            panels,
        };
        for (channel, output) in range.enumerate() {
            channels.bound(channel, layer, output);
        }
        channels
    }

    fn bound(&mut self, channel: usize, layer: &Dense, output: usize) {
        let weights = &layer.weight[output * layer.inputs..][..layer.inputs];
        let sum: f64 = weights.iter().map(|w| f64::from(w.abs())).sum();
        // If all weights are 0, every product is 0.
        self.least[channel] = if sum == 0.0 { 0.0 } else { f32::NEG_INFINITY };
        let cut = if layer.relu { -layer.bias[output] } else { f32::NEG_INFINITY };
        self.least_seen[channel] = self.least[channel].max(cut);
        self.bounds[channel] = match sum {
            0.0 => Bound::default(),
            sum if ORDINARY.contains(&sum) => self.ordinary_bound(channel, weights, sum),
            _ => {
                // All estimates become 0, so that none is ruled out.
                self.panels.scales_mut()[channel] = 0.0;
                Bound { rounding: f32::INFINITY, ..Bound::default() }
            }
        };
    }

    fn ordinary_bound(&self, channel: usize, weights: &[f32], sum: f64) -> Bound {
        let step = f64::from(self.panels.scales()[channel]);
        let rest = |(input, &w): (usize, &f32)| {
            f64::from(w) - step * f64::from(self.panels.weight(input, channel))
        };
        let norm = |squares: f64| (squares.sqrt() * NORM_SLACK) as f32;
        Bound {
            of_levels: norm(weights.iter().enumerate().map(|w| rest(w).powi(2)).sum()),
            of_lost: norm(weights.iter().map(|&w| f64::from(w).powi(2)).sum()),
            rounding: ((weights.len() + 64) as f64 * 127.0 * 2f64.powi(-24) * sum) as f32,
        }
    }

    /// Writes an estimate of every product, in units of levels, and the bound of each channel to
    /// `prefilter_scratch`.
    fn estimate(
        &self,
        kernels: &Kernels,
        rows: &Rows<'_, f32>,
        levels: &Levels,
        prefilter_scratch: &mut PrefilterScratch,
    ) {
        let gemm = I8::gemm(kernels).expect("invariant: kernels that prefilter have int8 products");
        let width = self.panels.padded_outputs();
        let bytes = Rows::new(&levels.bytes[..], rows.stride(), rows.n());
        let out = &mut prefilter_scratch.estimates[..rows.n() * width];
        (gemm.rows)(&bytes, &self.panels, 0..self.panels.n_panels(), out, width);
        for (out, bound) in prefilter_scratch.bounds.iter_mut().zip(&self.bounds) {
            *out = bound.of_levels * levels.norm + bound.of_lost * levels.lost + bound.rounding;
        }
    }
}

#[cfg(test)]
mod tests;
