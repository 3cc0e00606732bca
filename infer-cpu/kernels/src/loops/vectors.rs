//! Kernels on vectors: products with columns, rounding, distances.

#![expect(clippy::needless_range_loop, reason = "vectors and points go by their number")]

use std::ops::Range;

use super::products::finish;
use super::{Lanes, Vector, Weight};
use crate::table::{Candidate, LevelSums, Soa};
use crate::{GEMV_NR, I8_LARGEST, Panels, Rows, WIDTH_STEP, scalar};

/// [`crate::Gemv`]: the sums of a panel stay in `B` vectors while its columns stream by,
/// separately for even and odd inputs to hide latency.
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn gemv<L: Lanes, W: Weight, const B: usize>(
    nonzero: &[(u32, f32)],
    weights: &Panels<W>,
    panels: Range<usize>,
    out: &mut [f32],
) {
    assert!(B * L::N == GEMV_NR && weights.nr() == GEMV_NR && panels.end <= weights.n_panels());
    // The loop addresses columns without bounds checks.
    assert!(nonzero.iter().all(|&(j, _)| (j as usize) < weights.inputs()));
    for (panel, out) in panels.zip(out.chunks_exact_mut(GEMV_NR)) {
        let columns = weights.panel(panel).as_ptr();
        // SAFETY: all inputs are below `inputs`, and `Panels` has a column of GEMV_NR weights for
        // each, as many biases, and as many scales if there are any.
        unsafe {
            let mut sums = [[L::splat(0.0); B]; 2];
            let pairs = nonzero.chunks_exact(2);
            let last = pairs.remainder();
            for pair in pairs {
                for (sums, &(j, value)) in sums.iter_mut().zip(pair) {
                    add_column(sums, columns.add(j as usize * GEMV_NR), value);
                }
            }
            for &(j, value) in last {
                add_column(&mut sums[0], columns.add(j as usize * GEMV_NR), value);
            }
            for v in 0..B {
                let channel = panel * GEMV_NR + v * L::N;
                let value = finish(sums[0][v].add(sums[1][v]), weights, channel);
                value.store(out.as_mut_ptr().add(v * L::N));
            }
        }
    }
}

/// Adds a column times `value`.
///
/// # Safety
/// The instruction set of `L`; `column` has `B` vectors of weights.
#[inline(always)]
unsafe fn add_column<L: Lanes, W: Weight, const B: usize>(
    sums: &mut [L; B],
    column: *const W,
    value: f32,
) {
    for (v, sum) in sums.iter_mut().enumerate() {
        // SAFETY: `Panels` has GEMV_NR = B * N weights in each column.
        unsafe { *sum = W::lanes::<L>(column.add(v * L::N)).fma(L::splat(value), *sum) };
    }
}

/// [`crate::Kernels::narrow_i8`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn narrow_i8<L: Lanes>(values: &[f32], per_unit: f32, out: &mut [u8]) -> u64 {
    let whole = values.len().min(out.len()) / L::N * L::N;
    let mut clipped = 0;
    // SAFETY: the loop covers whole vectors of both slices.
    unsafe {
        let most = L::splat(f32::from(I8_LARGEST));
        for at in (0..whole).step_by(L::N) {
            let level = L::load(values.as_ptr().add(at)).mul(L::splat(per_unit)).round();
            clipped += u64::from(level.greater(most).count_ones());
            level.max(L::splat(0.0)).min(most).store_u8(out.as_mut_ptr().add(at));
        }
    }
    clipped + scalar::narrow_i8(&values[whole..], per_unit, &mut out[whole..])
}

/// [`crate::PrefilterKernels::levels`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn levels<L: Lanes>(row: &[f32], per_unit: f32, out: &mut [u8]) -> LevelSums {
    assert!(row.len().is_multiple_of(WIDTH_STEP) && out.len() == row.len());
    // SAFETY: the loop covers whole vectors of both slices.
    unsafe {
        let most = L::splat(f32::from(I8_LARGEST));
        let (mut lost, mut squares) = (L::splat(0.0), L::splat(0.0));
        for at in (0..row.len()).step_by(L::N) {
            let exact = L::load(row.as_ptr().add(at)).mul(L::splat(per_unit));
            let level = exact.round().max(L::splat(0.0)).min(most);
            let rest = exact.sub(level);
            lost = rest.fma(rest, lost);
            squares = level.fma(level, squares);
            level.store_u8(out.as_mut_ptr().add(at));
        }
        LevelSums { lost: lost.total(), squares: squares.total() }
    }
}

/// [`crate::PrefilterKernels::peaks`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn peaks<L: Lanes>(values: &[f32], peaks: &mut [f32], rows: &mut [u32]) {
    let width = peaks.len();
    assert!(rows.len() == width && width.is_multiple_of(WIDTH_STEP));
    // SAFETY: rows and results are `width` long, whole vectors.
    unsafe {
        for at in (0..width).step_by(L::N) {
            // Rows are the inner loop, so that peaks stay in registers.
            let (mut peak, mut who) = (L::splat(f32::NEG_INFINITY), L::Int::splat(0));
            for (row, values) in values.chunks_exact(width).enumerate() {
                let value = L::load(values.as_ptr().add(at));
                value.keep_greater(&mut peak, &mut who, L::Int::splat(row as i32));
            }
            peak.store(peaks.as_mut_ptr().add(at));
            who.store(rows.as_mut_ptr().add(at).cast());
        }
    }
}

/// [`crate::PrefilterKernels::above_floors`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn above_floors<L: Lanes>(
    values: &[f32],
    floors: &[f32],
    found: &mut [Candidate],
) -> Option<usize> {
    let width = floors.len();
    assert!(width.is_multiple_of(WIDTH_STEP));
    let mut n = 0;
    for (row, values) in values.chunks_exact(width).enumerate() {
        for at in (0..width).step_by(L::N) {
            // SAFETY: rows and floors are `width` long, whole vectors.
            let mut above = unsafe {
                L::load(values.as_ptr().add(at)).greater(L::load(floors.as_ptr().add(at)))
            };
            // Candidates are rare: most masks are 0.
            while above != 0 {
                let channel = (at + above.trailing_zeros() as usize) as u16;
                *found.get_mut(n)? = Candidate { row: row as u16, channel };
                n += 1;
                above &= above - 1;
            }
        }
    }
    Some(n)
}

/// [`crate::PrefilterKernels::dots`]: four sums, of every fourth vector each, hide latency.
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn dots<L: Lanes>(
    rows: &Rows<'_, f32>,
    weights: &[f32],
    candidates: &[Candidate],
    out: &mut [f32],
) {
    const SUMS: usize = 4;
    let width = rows.stride();
    assert!(width.is_multiple_of(WIDTH_STEP));
    for (candidate, out) in candidates.iter().zip(out) {
        let row = &rows.data()[usize::from(candidate.row) * width..][..width];
        let weights = &weights[usize::from(candidate.channel) * width..][..width];
        // SAFETY: both are `width` long, a multiple of `SUMS` vectors.
        unsafe {
            let mut sums = [L::splat(0.0); SUMS];
            for at in (0..width).step_by(SUMS * L::N) {
                for (s, sum) in sums.iter_mut().enumerate() {
                    let a = L::load(row.as_ptr().add(at + s * L::N));
                    *sum = a.fma(L::load(weights.as_ptr().add(at + s * L::N)), *sum);
                }
            }
            *out = sums[0].add(sums[1]).add(sums[2].add(sums[3])).total();
        }
    }
}

/// [`crate::Kernels::fps_step`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn fps_step<L: Lanes>(
    cloud: Soa<'_>,
    pick: [f32; 3],
    distance: &mut [f32],
) -> usize {
    let n = distance.len();
    assert!(cloud.x.len() >= n && cloud.y.len() >= n && cloud.z.len() >= n);
    let whole = n / L::N * L::N;
    let mut best = [-1.0f32; 16];
    let mut who = [i32::MAX; 16];
    // SAFETY: `whole` covers whole vectors of all slices; a vector has at most 16 lanes.
    unsafe {
        let (mut most, mut at_most) = (L::splat(-1.0), L::Int::splat(0));
        // The number of the point in each lane, which `keep_greater` stores.
        let mut index =
            L::Int::load([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15].as_ptr());
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
            index = index.add(L::Int::splat(L::N as i32));
        }
        most.store(best.as_mut_ptr());
        at_most.store(who.as_mut_ptr());
    }
    let lanes = best.into_iter().zip(who);
    let (largest, first) = lanes.fold((-1.0, i32::MAX), |found, lane| {
        // Lanes are not in the order of points: of equal distances, the lowest number wins.
        let better = lane.0 > found.0 || (lane.0 == found.0 && lane.1 < found.1);
        if better { lane } else { found }
    });
    let rest = Soa { x: &cloud.x[whole..], y: &cloud.y[whole..], z: &cloud.z[whole..] };
    let rest = whole + scalar::fps_step(rest, pick, &mut distance[whole..]);
    let is_farther = distance.get(rest).is_some_and(|&distance| distance > largest);
    // Of equal distances, the point in a whole vector comes first.
    if is_farther || whole == 0 { rest } else { first as usize }
}
