//! The reference: plain loops that round each step, in the order of inputs. All other kernels are
//! tested against it.

use std::ops::Range;

use crate::edge_conv::EdgeConv;
use crate::neighbor_pool::NeighborPool;
use crate::table::{Candidate, Gemm, LevelSums, PrefilterKernels, Soa, Sum, declare_kernels};
use crate::{I8_LARGEST, Panels, Rows};

declare_kernels!(Scalar, runs_here: true, {
    f32: gemm::<f32>(1),
    i8: Some(gemm::<u8>(4)),
    prefilters: false,
    prefilter: PrefilterKernels { levels, peaks, above_floors, dots },
    gemv_f32: gemv::<f32>,
    gemv_i8: gemv::<i8>,
    narrow_i8,
    fps_step,
    edge_features: EdgeConv::features::<false>,
    pool_neighbors: NeighborPool::run::<false>,
});

/// An activation of one number format.
trait Activation: Copy {
    type Weight: Copy + Default;
    type Sum: Sum;
    /// The sum of the products of a row and the weights of `output`.
    fn dot(row: &[Self], weights: &Panels<Self::Weight>, output: usize) -> Self::Sum;
}

impl Activation for f32 {
    type Weight = f32;
    type Sum = f32;

    fn dot(row: &[f32], weights: &Panels<f32>, output: usize) -> f32 {
        let products = row.iter().enumerate();
        products.fold(0.0, |sum, (k, &a)| sum + a * weights.weight(k, output))
    }
}

impl Activation for u8 {
    type Weight = i8;
    type Sum = i32;

    fn dot(row: &[u8], weights: &Panels<i8>, output: usize) -> i32 {
        let products = row.iter().enumerate();
        products.map(|(k, &a)| i32::from(a) * i32::from(weights.weight(k, output))).sum()
    }
}

const fn gemm<A: Activation>(k_step: usize) -> Gemm<A, A::Weight, A::Sum> {
    Gemm { nr: 8, k_step, rows: rows::<A>, max: max::<A>, argmax: argmax::<A> }
}

fn rows<A: Activation>(
    rows: &Rows<'_, A>,
    weights: &Panels<A::Weight>,
    panels: Range<usize>,
    out: &mut [f32],
    out_stride: usize,
) {
    for_each(rows, weights, panels, |row, output, sum| {
        out[row * out_stride + output] = finish(weights, output, sum.to_f32());
    });
}

fn max<A: Activation>(
    rows: &Rows<'_, A>,
    weights: &Panels<A::Weight>,
    panels: Range<usize>,
    maxima: &mut [A::Sum],
) {
    let first = weights.channels(&panels).start;
    for_each(rows, weights, panels, |_, output, sum| {
        if sum > maxima[output - first] {
            maxima[output - first] = sum;
        }
    });
}

fn argmax<A: Activation>(
    rows: &Rows<'_, A>,
    weights: &Panels<A::Weight>,
    panels: Range<usize>,
    first_row: u32,
    maxima: &mut [A::Sum],
    winners: &mut [u32],
) {
    let first = weights.channels(&panels).start;
    for_each(rows, weights, panels, |row, output, sum| {
        if sum > maxima[output - first] {
            maxima[output - first] = sum;
            winners[output - first] = first_row + row as u32;
        }
    });
}

/// Calls `sink(row, output, sum)` for every row and every channel of `panels`.
fn for_each<A: Activation>(
    rows: &Rows<'_, A>,
    weights: &Panels<A::Weight>,
    panels: Range<usize>,
    mut sink: impl FnMut(usize, usize, A::Sum),
) {
    rows.check(weights.inputs());
    for row in 0..rows.n() {
        let activations = &rows.data()[row * rows.stride()..][..weights.inputs()];
        for output in weights.channels(&panels) {
            sink(row, output, A::dot(activations, weights, output));
        }
    }
}

fn finish<W: Copy + Default>(weights: &Panels<W>, output: usize, sum: f32) -> f32 {
    let scale = weights.scales().get(output).copied().unwrap_or(1.0);
    let value = sum * scale + weights.biases()[output];
    // `max` turns NaN into 0, as SIMD kernels do.
    if weights.relu { value.max(0.0) } else { value }
}

fn levels(row: &[f32], per_unit: f32, out: &mut [u8]) -> LevelSums {
    let mut sums = LevelSums::default();
    for (value, out) in row.iter().zip(out) {
        let exact = value * per_unit;
        let level = exact.round_ties_even().clamp(0.0, f32::from(I8_LARGEST));
        sums.lost += (exact - level) * (exact - level);
        sums.squares += level * level;
        // The cast turns NaN, which `clamp` keeps, into level 0.
        *out = level as u8;
    }
    sums
}

fn peaks(values: &[f32], peaks: &mut [f32], rows: &mut [u32]) {
    peaks.fill(f32::NEG_INFINITY);
    rows.fill(0);
    for (row, values) in (0..).zip(values.chunks_exact(peaks.len())) {
        for (channel, &value) in values.iter().enumerate() {
            if value > peaks[channel] {
                (peaks[channel], rows[channel]) = (value, row);
            }
        }
    }
}

fn above_floors(values: &[f32], floors: &[f32], found: &mut [Candidate]) -> Option<usize> {
    let mut n = 0;
    for (row, values) in values.chunks_exact(floors.len()).enumerate() {
        for (channel, _) in values.iter().enumerate().filter(|&(c, value)| *value > floors[c]) {
            // Too many candidates: the caller then computes all products.
            *found.get_mut(n)? = Candidate { row: row as u16, channel: channel as u16 };
            n += 1;
        }
    }
    Some(n)
}

fn dots(rows: &Rows<'_, f32>, weights: &[f32], candidates: &[Candidate], out: &mut [f32]) {
    for (candidate, out) in candidates.iter().zip(out) {
        let row = &rows.data()[usize::from(candidate.row) * rows.stride()..][..rows.stride()];
        let weights = &weights[usize::from(candidate.channel) * rows.stride()..][..rows.stride()];
        *out = row.iter().zip(weights).fold(0.0, |sum, (a, w)| sum + a * w);
    }
}

fn gemv<W: Copy + Default + Into<f32>>(
    nonzero: &[(u32, f32)],
    weights: &Panels<W>,
    panels: Range<usize>,
    out: &mut [f32],
) {
    for (out, output) in out.iter_mut().zip(weights.channels(&panels)) {
        let products = nonzero.iter();
        let dot = products.fold(0.0f32, |sum, &(j, value)| {
            sum + value * weights.weight(j as usize, output).into()
        });
        *out = finish(weights, output, dot);
    }
}

pub(super) fn narrow_i8(values: &[f32], per_unit: f32, out: &mut [u8]) -> u64 {
    let mut clipped = 0;
    for (value, out) in values.iter().zip(out) {
        let level = (value * per_unit).round_ties_even();
        clipped += u64::from(level > f32::from(I8_LARGEST));
        *out = level.clamp(0.0, f32::from(I8_LARGEST)) as u8;
    }
    clipped
}

pub(super) fn fps_step(cloud: Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize {
    let mut farthest = 0;
    let mut largest = -1.0;
    for (i, distance) in distance.iter_mut().enumerate() {
        let [dx, dy, dz] = [cloud.x[i] - pick[0], cloud.y[i] - pick[1], cloud.z[i] - pick[2]];
        let squared = (dx * dx + dy * dy) + dz * dz;
        // False for NaN, which keeps the distance.
        if squared < *distance {
            *distance = squared;
        }
        // Strictly greater, so that the first of equal distances wins.
        if *distance > largest {
            largest = *distance;
            farthest = i;
        }
    }
    farthest
}
