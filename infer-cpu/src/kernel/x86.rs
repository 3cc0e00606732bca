//! What AVX2 and AVX-512 kernels share: the same loops over vectors of another
//! length. Everything here is inlined into functions that enable the
//! instructions, in [`super::avx2`] and [`super::avx512`].
//!
//! The register tile of R rows and V vectors of output channels, lanes along
//! channels:
//!
//! ```text
//!              w[k, 0..n]   w[k, n..2n]     one panel, V = 2
//! a[0, k]  ->    acc 0,0      acc 0,1       a is splat from memory,
//! a[1, k]  ->    acc 1,0      acc 1,1       row-major, unpacked
//!   ...
//! ```

#![expect(clippy::needless_range_loop, reason = "vectors and points go by their number")]

use std::ops::Range;

use half::f16;

use super::{Columns, I8_LARGEST, Panels, Rows, Soa};

/// Vectors of channels in a tile.
pub(super) const V: usize = 2;
/// Inputs of fp16 rows that are widened at a time.
const WIDENED: usize = 128;

/// A vector of f32 and one of i32 of as many lanes.
///
/// # Safety
/// Every function needs the instruction set of its implementor; those that
/// take a pointer need [`Lanes::N`] elements there.
pub(super) trait Lanes: Copy {
    /// As many lanes of i32.
    type Int: Copy;
    /// How many lanes.
    const N: usize;
    /// Rows of a tile.
    const ROWS: usize;

    unsafe fn splat(value: f32) -> Self;
    unsafe fn load(from: *const f32) -> Self;
    unsafe fn load_f16(from: *const f16) -> Self;
    unsafe fn load_i8(from: *const i8) -> Self;
    unsafe fn store(self, to: *mut f32);
    unsafe fn store_f16(self, to: *mut f16);
    /// Stores integers in 0..=127 as bytes.
    unsafe fn store_u8(self, to: *mut u8);
    /// `self * factor + term`, rounded once.
    unsafe fn fma(self, factor: Self, term: Self) -> Self;
    unsafe fn mul(self, other: Self) -> Self;
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    /// The larger; `other` if either is NaN.
    unsafe fn max(self, other: Self) -> Self;
    /// The smaller; `other` if either is NaN.
    unsafe fn min(self, other: Self) -> Self;
    unsafe fn abs(self) -> Self;
    /// To the nearest integer, ties to even.
    unsafe fn round(self) -> Self;
    /// How many lanes are greater than those of `other`.
    unsafe fn count_greater(self, other: Self) -> u32;
    /// Where `self` is greater than `best`: puts it there, and `index` into
    /// `who`.
    unsafe fn keep_greater(self, best: &mut Self, who: &mut Self::Int, index: Self::Int);

    unsafe fn splat_int(value: i32) -> Self::Int;
    unsafe fn load_int(from: *const i32) -> Self::Int;
    unsafe fn store_int(int: Self::Int, to: *mut i32);
    unsafe fn add_int(a: Self::Int, b: Self::Int) -> Self::Int;
    unsafe fn max_int(a: Self::Int, b: Self::Int) -> Self::Int;
    unsafe fn keep_greater_int(
        value: Self::Int,
        best: &mut Self::Int,
        who: &mut Self::Int,
        index: Self::Int,
    );
    /// Adds to each lane of `sum` the products of four unsigned bytes (at most
    /// 127) and four signed ones.
    unsafe fn dot4(sum: Self::Int, a: Self::Int, w: Self::Int) -> Self::Int;
    unsafe fn to_float(int: Self::Int) -> Self;
}

/// A weight that a kernel reads as f32.
pub(super) trait Weight: Copy + Default {
    unsafe fn lanes<L: Lanes>(from: *const Self) -> L;
}

impl Weight for f32 {
    #[inline(always)]
    unsafe fn lanes<L: Lanes>(from: *const f32) -> L {
        // SAFETY: as the caller promises.
        unsafe { L::load(from) }
    }
}

impl Weight for f16 {
    #[inline(always)]
    unsafe fn lanes<L: Lanes>(from: *const f16) -> L {
        // SAFETY: as the caller promises.
        unsafe { L::load_f16(from) }
    }
}

impl Weight for i8 {
    #[inline(always)]
    unsafe fn lanes<L: Lanes>(from: *const i8) -> L {
        // SAFETY: as the caller promises.
        unsafe { L::load_i8(from) }
    }
}

/// One format's tile of `R` rows.
pub(super) trait Tile<L: Lanes> {
    type Activation: Copy;
    type Weight: Copy + Default;
    type Sum: Copy;
    /// A vector of sums.
    type Sums: Copy;

    /// The sums of `R` rows and one panel.
    ///
    /// # Safety
    /// `R` rows of `panel.len() / nr` activations, `stride` apart, at `rows`.
    unsafe fn sums<const R: usize>(
        rows: *const Self::Activation,
        stride: usize,
        panel: &[Self::Weight],
    ) -> [[Self::Sums; V]; R];
    unsafe fn float(sums: Self::Sums) -> L;
    unsafe fn load(from: *const Self::Sum) -> Self::Sums;
    unsafe fn store(sums: Self::Sums, to: *mut Self::Sum);
    unsafe fn max(sums: Self::Sums, best: Self::Sums) -> Self::Sums;
    unsafe fn keep_greater(
        sums: Self::Sums,
        best: &mut Self::Sums,
        who: &mut L::Int,
        index: L::Int,
    );
}

/// fp32 rows and weights.
pub(super) struct Single;
/// fp16 rows and weights, fp32 arithmetic.
pub(super) struct Half;
/// Byte rows and weights.
pub(super) struct Byte;

#[inline(always)]
unsafe fn accumulate<L: Lanes, W: Weight, const R: usize>(
    acc: &mut [[L; V]; R],
    rows: *const f32,
    stride: usize,
    panel: *const W,
    k: usize,
) {
    for k in 0..k {
        // SAFETY: panel and rows have k inputs, as the caller promises.
        unsafe {
            let w: [L; V] = std::array::from_fn(|v| W::lanes(panel.add((k * V + v) * L::N)));
            for (r, acc) in acc.iter_mut().enumerate() {
                let a = L::splat(*rows.add(r * stride + k));
                for v in 0..V {
                    acc[v] = a.fma(w[v], acc[v]);
                }
            }
        }
    }
}

macro_rules! float_sums {
    ($activation:ty) => {
        type Activation = $activation;
        type Weight = $activation;
        type Sum = f32;
        type Sums = L;

        #[inline(always)]
        unsafe fn float(sums: L) -> L {
            sums
        }

        #[inline(always)]
        unsafe fn load(from: *const f32) -> L {
            // SAFETY: as the caller promises.
            unsafe { L::load(from) }
        }

        #[inline(always)]
        unsafe fn store(sums: L, to: *mut f32) {
            // SAFETY: as the caller promises.
            unsafe { sums.store(to) }
        }

        #[inline(always)]
        unsafe fn max(sums: L, best: L) -> L {
            // SAFETY: as the caller promises.
            unsafe { sums.max(best) }
        }

        #[inline(always)]
        unsafe fn keep_greater(sums: L, best: &mut L, who: &mut L::Int, index: L::Int) {
            // SAFETY: as the caller promises.
            unsafe { sums.keep_greater(best, who, index) }
        }
    };
}

impl<L: Lanes> Tile<L> for Single {
    float_sums!(f32);

    #[inline(always)]
    unsafe fn sums<const R: usize>(rows: *const f32, stride: usize, panel: &[f32]) -> [[L; V]; R] {
        // SAFETY: as the caller promises.
        unsafe {
            let mut acc = [[L::splat(0.0); V]; R];
            accumulate(&mut acc, rows, stride, panel.as_ptr(), panel.len() / (V * L::N));
            acc
        }
    }
}

impl<L: Lanes> Tile<L> for Half {
    float_sums!(f16);

    #[inline(always)]
    unsafe fn sums<const R: usize>(rows: *const f16, stride: usize, panel: &[f16]) -> [[L; V]; R] {
        // SAFETY: as the caller promises; panels' inputs are whole vectors.
        unsafe {
            let mut acc = [[L::splat(0.0); V]; R];
            let mut wide = [[0.0f32; WIDENED]; R];
            for (chunk, panel) in panel.chunks(WIDENED * V * L::N).enumerate() {
                let k = panel.len() / (V * L::N);
                for (r, wide) in wide.iter_mut().enumerate() {
                    let row = rows.add(r * stride + chunk * WIDENED);
                    for at in (0..k).step_by(L::N) {
                        L::load_f16(row.add(at)).store(wide.as_mut_ptr().add(at));
                    }
                }
                accumulate(&mut acc, wide.as_ptr().cast(), WIDENED, panel.as_ptr(), k);
            }
            acc
        }
    }
}

impl<L: Lanes> Tile<L> for Byte {
    type Activation = u8;
    type Weight = i8;
    type Sum = i32;
    type Sums = L::Int;

    #[inline(always)]
    unsafe fn sums<const R: usize>(
        rows: *const u8,
        stride: usize,
        panel: &[i8],
    ) -> [[L::Int; V]; R] {
        // SAFETY: as the caller promises; panels' inputs are whole groups of 4.
        unsafe {
            let mut acc = [[L::splat_int(0); V]; R];
            let panel_start = panel.as_ptr().cast::<i32>();
            for group in 0..panel.len() / (4 * V * L::N) {
                let w: [L::Int; V] =
                    std::array::from_fn(|v| L::load_int(panel_start.add((group * V + v) * L::N)));
                for (r, acc) in acc.iter_mut().enumerate() {
                    let four = rows.add(r * stride + group * 4).cast::<i32>().read_unaligned();
                    let a = L::splat_int(four);
                    for v in 0..V {
                        acc[v] = L::dot4(acc[v], a, w[v]);
                    }
                }
            }
            acc
        }
    }

    #[inline(always)]
    unsafe fn float(sums: L::Int) -> L {
        // SAFETY: as the caller promises.
        unsafe { L::to_float(sums) }
    }

    #[inline(always)]
    unsafe fn load(from: *const i32) -> L::Int {
        // SAFETY: as the caller promises.
        unsafe { L::load_int(from) }
    }

    #[inline(always)]
    unsafe fn store(sums: L::Int, to: *mut i32) {
        // SAFETY: as the caller promises.
        unsafe { L::store_int(sums, to) }
    }

    #[inline(always)]
    unsafe fn max(sums: L::Int, best: L::Int) -> L::Int {
        // SAFETY: as the caller promises.
        unsafe { L::max_int(sums, best) }
    }

    #[inline(always)]
    unsafe fn keep_greater(sums: L::Int, best: &mut L::Int, who: &mut L::Int, index: L::Int) {
        // SAFETY: as the caller promises.
        unsafe { L::keep_greater_int(sums, best, who, index) }
    }
}

/// Runs `$body` with `$r` rows known when compiling: a full tile, or what is
/// left.
macro_rules! for_tiles {
    ($lanes:ty, $n:expr, |$row:ident, $r:ident| $body:expr) => {{
        let mut $row = 0;
        while $row < $n {
            let left = ($n - $row).min(<$lanes>::ROWS);
            macro_rules! rows {
                ($count:literal) => {{
                    const $r: usize = $count;
                    $body
                }};
            }
            match left {
                1 => rows!(1),
                2 => rows!(2),
                3 => rows!(3),
                4 => rows!(4),
                5 => rows!(5),
                6 => rows!(6),
                7 => rows!(7),
                8 => rows!(8),
                9 => rows!(9),
                10 => rows!(10),
                11 => rows!(11),
                _ => rows!(12),
            }
            $row += left;
        }
    }};
}

/// [`super::Gemm::rows`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(super) unsafe fn rows<L: Lanes, T: Tile<L>>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    out: &mut [f32],
    out_stride: usize,
) {
    rows.check(weights.padded_inputs);
    if rows.n == 0 {
        return;
    }
    assert!(weights.nr == V * L::N && panels.end <= weights.n_panels());
    assert!(panels.end * weights.nr <= out_stride);
    assert!((rows.n - 1) * out_stride + panels.end * weights.nr <= out.len());
    for panel in panels {
        let first = panel * weights.nr;
        let data = weights.panel(panel);
        for_tiles!(L, rows.n, |row, R| {
            // SAFETY: rows and outputs were checked above.
            unsafe {
                let from = rows.data.as_ptr().add(row * rows.stride);
                let sums = T::sums::<R>(from, rows.stride, data);
                for (r, sums) in sums.into_iter().enumerate() {
                    for (v, sums) in sums.into_iter().enumerate() {
                        let channel = first + v * L::N;
                        let value = finish::<L, _>(T::float(sums), weights, channel);
                        value.store(out.as_mut_ptr().add((row + r) * out_stride + channel));
                    }
                }
            }
        });
    }
}

/// Scale, bias and ReLU of the channels from `channel`.
#[inline(always)]
unsafe fn finish<L: Lanes, W>(value: L, weights: &Panels<W>, channel: usize) -> L {
    // SAFETY: scales and biases are padded to whole panels.
    unsafe {
        let bias = L::load(weights.bias.as_ptr().add(channel));
        let value = if weights.scale.is_empty() {
            value.add(bias)
        } else {
            value.fma(L::load(weights.scale.as_ptr().add(channel)), bias)
        };
        if weights.relu { value.max(L::splat(0.0)) } else { value }
    }
}

/// [`super::Gemm::max`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(super) unsafe fn max<L: Lanes, T: Tile<L>>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    maxima: &mut [T::Sum],
) {
    rows.check(weights.padded_inputs);
    assert!(weights.nr == V * L::N && panels.end <= weights.n_panels());
    assert!(maxima.len() == panels.len() * weights.nr);
    for (panel, maxima) in panels.zip(maxima.chunks_exact_mut(V * L::N)) {
        let data = weights.panel(panel);
        // SAFETY: a chunk has V vectors; rows were checked above.
        unsafe {
            let mut best: [T::Sums; V] =
                std::array::from_fn(|v| T::load(maxima.as_ptr().add(v * L::N)));
            for_tiles!(L, rows.n, |row, R| {
                let from = rows.data.as_ptr().add(row * rows.stride);
                for sums in T::sums::<R>(from, rows.stride, data) {
                    for v in 0..V {
                        best[v] = T::max(sums[v], best[v]);
                    }
                }
            });
            for (v, best) in best.into_iter().enumerate() {
                T::store(best, maxima.as_mut_ptr().add(v * L::N));
            }
        }
    }
}

/// [`super::Gemm::argmax`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(super) unsafe fn argmax<L: Lanes, T: Tile<L>>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    first_row: u32,
    maxima: &mut [T::Sum],
    winners: &mut [u32],
) {
    rows.check(weights.padded_inputs);
    assert!(weights.nr == V * L::N && panels.end <= weights.n_panels());
    assert!(maxima.len() == panels.len() * weights.nr && winners.len() == maxima.len());
    let chunks = maxima.chunks_exact_mut(V * L::N).zip(winners.chunks_exact_mut(V * L::N));
    for (panel, (maxima, winners)) in panels.zip(chunks) {
        let data = weights.panel(panel);
        let winners = winners.as_mut_ptr().cast::<i32>();
        // SAFETY: a chunk has V vectors; rows were checked above.
        unsafe {
            let mut best: [T::Sums; V] =
                std::array::from_fn(|v| T::load(maxima.as_ptr().add(v * L::N)));
            let mut who: [L::Int; V] = std::array::from_fn(|v| L::load_int(winners.add(v * L::N)));
            for_tiles!(L, rows.n, |row, R| {
                let from = rows.data.as_ptr().add(row * rows.stride);
                let sums = T::sums::<R>(from, rows.stride, data);
                for (r, sums) in sums.into_iter().enumerate() {
                    let index = L::splat_int((first_row + (row + r) as u32) as i32);
                    for v in 0..V {
                        T::keep_greater(sums[v], &mut best[v], &mut who[v], index);
                    }
                }
            });
            for v in 0..V {
                T::store(best[v], maxima.as_mut_ptr().add(v * L::N));
                L::store_int(who[v], winners.add(v * L::N));
            }
        }
    }
}

/// [`super::Gemv`]: a block's sums stay in `B` vectors while its columns
/// stream by, even and odd inputs apart for the sake of latency.
///
/// # Safety
/// The instruction set of `L`; `B` vectors are a block.
#[inline(always)]
pub(super) unsafe fn gemv<L: Lanes, W: Weight, const B: usize>(
    nonzero: &[(u32, f32)],
    weights: &Columns<W>,
    blocks: Range<usize>,
    out: &mut [f32],
) {
    const BLOCK: usize = Columns::<f32>::BLOCK;
    assert!(B * L::N == BLOCK && blocks.end <= weights.n_blocks());
    assert!(nonzero.iter().all(|&(j, _)| (j as usize) < weights.inputs));
    for (block, out) in blocks.zip(out.chunks_exact_mut(BLOCK)) {
        let columns = weights.block(block).as_ptr();
        // SAFETY: every input has a column of B vectors, and the block its
        // scales and biases.
        unsafe {
            let mut sums = [[L::splat(0.0); B]; 2];
            let pairs = nonzero.chunks_exact(2);
            let last = pairs.remainder();
            for pair in pairs {
                for (sums, &(j, value)) in sums.iter_mut().zip(pair) {
                    add_column(sums, columns.add(j as usize * BLOCK), value);
                }
            }
            for &(j, value) in last {
                add_column(&mut sums[0], columns.add(j as usize * BLOCK), value);
            }
            for v in 0..B {
                let channel = block * BLOCK + v * L::N;
                let bias = L::load(weights.bias.as_ptr().add(channel));
                let sum = sums[0][v].add(sums[1][v]);
                let value = if weights.scale.is_empty() {
                    sum.add(bias)
                } else {
                    sum.fma(L::load(weights.scale.as_ptr().add(channel)), bias)
                };
                value.store(out.as_mut_ptr().add(v * L::N));
            }
        }
    }
}

#[inline(always)]
unsafe fn add_column<L: Lanes, W: Weight, const B: usize>(
    sums: &mut [L; B],
    column: *const W,
    value: f32,
) {
    for (v, sum) in sums.iter_mut().enumerate() {
        // SAFETY: as the caller promises.
        unsafe { *sum = W::lanes::<L>(column.add(v * L::N)).fma(L::splat(value), *sum) };
    }
}

/// [`super::Kernels::narrow_f16`] of whole vectors; returns how many values
/// that were, and the largest magnitude.
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(super) unsafe fn narrow_f16<L: Lanes>(values: &[f32], out: &mut [f16]) -> (usize, f32) {
    let whole = values.len().min(out.len()) / L::N * L::N;
    // SAFETY: whole vectors of both.
    unsafe {
        let mut largest = L::splat(0.0);
        for at in (0..whole).step_by(L::N) {
            let value = L::load(values.as_ptr().add(at));
            value.store_f16(out.as_mut_ptr().add(at));
            largest = value.abs().max(largest);
        }
        let mut lanes = [0.0f32; 16];
        largest.store(lanes.as_mut_ptr());
        (whole, lanes.into_iter().fold(0.0, f32::max))
    }
}

/// [`super::Kernels::narrow_i8`] of whole vectors; returns how many values
/// that were, and how many were clipped.
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(super) unsafe fn narrow_i8<L: Lanes>(
    values: &[f32],
    per_unit: f32,
    out: &mut [u8],
) -> (usize, u64) {
    let whole = values.len().min(out.len()) / L::N * L::N;
    // SAFETY: whole vectors of both.
    unsafe {
        let most = L::splat(f32::from(I8_LARGEST));
        let mut clipped = 0;
        for at in (0..whole).step_by(L::N) {
            let level = L::load(values.as_ptr().add(at)).mul(L::splat(per_unit)).round();
            clipped += u64::from(level.count_greater(most));
            level.max(L::splat(0.0)).min(most).store_u8(out.as_mut_ptr().add(at));
        }
        (whole, clipped)
    }
}

/// [`super::Kernels::fps_step`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(super) unsafe fn fps_step<L: Lanes>(
    cloud: Soa<'_>,
    pick: [f32; 3],
    distance: &mut [f32],
) -> usize {
    let n = distance.len();
    assert!(cloud.x.len() >= n && cloud.y.len() >= n && cloud.z.len() >= n);
    let whole = n / L::N * L::N;
    let mut best = [-1.0f32; 16];
    let mut who = [i32::MAX; 16];
    // SAFETY: whole vectors of all; 16 lanes at most.
    unsafe {
        let (mut most, mut at_most) = (L::splat(-1.0), L::splat_int(0));
        let mut index =
            L::load_int([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15].as_ptr());
        let from = |axis: &[f32], at, pick| L::load(axis.as_ptr().add(at)).sub(L::splat(pick));
        for at in (0..whole).step_by(L::N) {
            let (dx, dy, dz) = (
                from(cloud.x, at, pick[0]),
                from(cloud.y, at, pick[1]),
                from(cloud.z, at, pick[2]),
            );
            let squared = dx.mul(dx).add(dy.mul(dy)).add(dz.mul(dz));
            let nearest = squared.min(L::load(distance.as_ptr().add(at)));
            nearest.store(distance.as_mut_ptr().add(at));
            nearest.keep_greater(&mut most, &mut at_most, index);
            index = L::add_int(index, L::splat_int(L::N as i32));
        }
        most.store(best.as_mut_ptr());
        L::store_int(at_most, who.as_mut_ptr());
    }
    let lanes = best.into_iter().zip(who);
    let (mut largest, first) = lanes.fold((-1.0, i32::MAX), |found, lane| {
        let better = lane.0 > found.0 || (lane.0 == found.0 && lane.1 < found.1);
        if better { lane } else { found }
    });
    let mut farthest = if whole == 0 { 0 } else { first as usize };
    for i in whole..n {
        let [dx, dy, dz] = [cloud.x[i] - pick[0], cloud.y[i] - pick[1], cloud.z[i] - pick[2]];
        let squared = (dx * dx + dy * dy) + dz * dz;
        distance[i] = if squared < distance[i] { squared } else { distance[i] };
        if distance[i] > largest {
            (largest, farthest) = (distance[i], i);
        }
    }
    farthest
}

/// The safe functions of a table of kernels over vectors `$lanes`, whose
/// blocks of columns take `$b` vectors.
///
/// They enable `$features` without looking: the table that holds them is
/// given out only where the machine has been found to have them.
macro_rules! entries {
    ($lanes:ty, $b:literal, $features:literal) => {
        use $crate::kernel::x86::{self, Byte, Half, Single};
        use $crate::kernel::{Columns, Panels, Rows, Soa};

        $crate::kernel::x86::entries!(@gemm $lanes, $features, Single, f32, f32, f32,
            f32_rows, f32_max, f32_argmax);
        $crate::kernel::x86::entries!(@gemm $lanes, $features, Half, f16, f16, f32,
            f16_rows, f16_max, f16_argmax);
        $crate::kernel::x86::entries!(@gemm $lanes, $features, Byte, u8, i8, i32,
            i8_rows, i8_max, i8_argmax);
        $crate::kernel::x86::entries!(@gemv $lanes, $features, $b, f32, gemv_f32);
        $crate::kernel::x86::entries!(@gemv $lanes, $features, $b, f16, gemv_f16);
        $crate::kernel::x86::entries!(@gemv $lanes, $features, $b, i8, gemv_i8);

        fn narrow_f16(values: &[f32], out: &mut [f16]) -> f32 {
            #[target_feature(enable = $features)]
            unsafe fn run(values: &[f32], out: &mut [f16]) -> (usize, f32) {
                // SAFETY: the features are enabled.
                unsafe { x86::narrow_f16::<$lanes>(values, out) }
            }
            // SAFETY: the table of these functions is given out after detection.
            let (whole, largest) = unsafe { run(values, out) };
            largest.max($crate::kernel::scalar::narrow_f16(&values[whole..], &mut out[whole..]))
        }

        fn narrow_i8(values: &[f32], per_unit: f32, out: &mut [u8]) -> u64 {
            #[target_feature(enable = $features)]
            unsafe fn run(values: &[f32], per_unit: f32, out: &mut [u8]) -> (usize, u64) {
                // SAFETY: the features are enabled.
                unsafe { x86::narrow_i8::<$lanes>(values, per_unit, out) }
            }
            // SAFETY: the table of these functions is given out after detection.
            let (whole, clipped) = unsafe { run(values, per_unit, out) };
            let (values, out) = (&values[whole..], &mut out[whole..]);
            clipped + $crate::kernel::scalar::narrow_i8(values, per_unit, out)
        }

        fn fps_step(cloud: Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize {
            #[target_feature(enable = $features)]
            unsafe fn run(cloud: Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize {
                // SAFETY: the features are enabled.
                unsafe { x86::fps_step::<$lanes>(cloud, pick, distance) }
            }
            // SAFETY: the table of these functions is given out after detection.
            unsafe { run(cloud, pick, distance) }
        }
    };
    (@gemm $lanes:ty, $features:literal, $tile:ty, $a:ty, $w:ty, $c:ty,
     $rows:ident, $max:ident, $argmax:ident) => {
        fn $rows(
            rows: &Rows<'_, $a>,
            weights: &Panels<$w>,
            panels: Range<usize>,
            out: &mut [f32],
            stride: usize,
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                rows: &Rows<'_, $a>,
                weights: &Panels<$w>,
                panels: Range<usize>,
                out: &mut [f32],
                stride: usize,
            ) {
                // SAFETY: the features are enabled.
                unsafe { x86::rows::<$lanes, $tile>(rows, weights, panels, out, stride) }
            }
            // SAFETY: the table of these functions is given out after detection.
            unsafe { run(rows, weights, panels, out, stride) }
        }

        fn $max(
            rows: &Rows<'_, $a>,
            weights: &Panels<$w>,
            panels: Range<usize>,
            maxima: &mut [$c],
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                rows: &Rows<'_, $a>,
                weights: &Panels<$w>,
                panels: Range<usize>,
                maxima: &mut [$c],
            ) {
                // SAFETY: the features are enabled.
                unsafe { x86::max::<$lanes, $tile>(rows, weights, panels, maxima) }
            }
            // SAFETY: the table of these functions is given out after detection.
            unsafe { run(rows, weights, panels, maxima) }
        }

        fn $argmax(
            rows: &Rows<'_, $a>,
            weights: &Panels<$w>,
            panels: Range<usize>,
            first_row: u32,
            maxima: &mut [$c],
            winners: &mut [u32],
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                rows: &Rows<'_, $a>,
                weights: &Panels<$w>,
                panels: Range<usize>,
                first_row: u32,
                maxima: &mut [$c],
                winners: &mut [u32],
            ) {
                // SAFETY: the features are enabled.
                unsafe {
                    x86::argmax::<$lanes, $tile>(
                        rows, weights, panels, first_row, maxima, winners,
                    );
                }
            }
            // SAFETY: the table of these functions is given out after detection.
            unsafe { run(rows, weights, panels, first_row, maxima, winners) }
        }
    };
    (@gemv $lanes:ty, $features:literal, $b:literal, $w:ty, $gemv:ident) => {
        fn $gemv(
            nonzero: &[(u32, f32)],
            weights: &Columns<$w>,
            blocks: Range<usize>,
            out: &mut [f32],
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                nonzero: &[(u32, f32)],
                weights: &Columns<$w>,
                blocks: Range<usize>,
                out: &mut [f32],
            ) {
                // SAFETY: the features are enabled.
                unsafe { x86::gemv::<$lanes, $w, $b>(nonzero, weights, blocks, out) }
            }
            // SAFETY: the table of these functions is given out after detection.
            unsafe { run(nonzero, weights, blocks, out) }
        }
    };
}
pub(super) use entries;
