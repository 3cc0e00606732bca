//! The kernels of the int8 prefilter: candidates among estimates, and their products.

use std::arch::aarch64::*;

use super::lanes::{Lanes, Sums};
use crate::table::{Candidate, LevelSums, PrefilterKernels};
use crate::{I8_LARGEST, Rows, WIDTH_STEP};

/// Estimates that are compared together, since candidates are few.
const BATCH: usize = 16;

pub const PREFILTER: PrefilterKernels = PrefilterKernels { levels, peaks, above_floors, dots };

fn levels(row: &[f32], per_unit: f32, out: &mut [u8]) -> LevelSums {
    assert!(row.len().is_multiple_of(WIDTH_STEP) && out.len() == row.len());
    let (batches, _) = row.as_chunks::<BATCH>();
    let (out, _) = out.as_chunks_mut::<BATCH>();
    let (mut lost, mut squares) = (float32x4_t::splat(0.0), float32x4_t::splat(0.0));
    for (batch, out) in batches.iter().zip(out) {
        let (values, _) = batch.as_chunks();
        // SAFETY: the array has sixteen elements. NEON is on every aarch64.
        unsafe {
            let most = vdupq_n_s32(i32::from(I8_LARGEST));
            let exact = [0, 1, 2, 3].map(|v| vmulq_n_f32(Lanes::load(&values[v]), per_unit));
            // Rounds to nearest, ties to even.
            let level =
                exact.map(|x| vminq_s32(vmaxq_s32(vcvtnq_s32_f32(x), vdupq_n_s32(0)), most));
            for (exact, level) in exact.into_iter().zip(level) {
                let level = vcvtq_f32_s32(level);
                let rest = vsubq_f32(exact, level);
                lost = vfmaq_f32(lost, rest, rest);
                squares = vfmaq_f32(squares, level, level);
            }
            let low = vqmovun_high_s32(vqmovun_s32(level[0]), level[1]);
            let high = vqmovun_high_s32(vqmovun_s32(level[2]), level[3]);
            vst1q_u8(out.as_mut_ptr(), vqmovn_high_u16(vqmovn_u16(low), high));
        }
    }
    // SAFETY: NEON is on every aarch64.
    unsafe { LevelSums { lost: vaddvq_f32(lost), squares: vaddvq_f32(squares) } }
}

fn peaks(values: &[f32], peaks: &mut [f32], rows: &mut [u32]) {
    let width = peaks.len();
    assert!(rows.len() == width && width.is_multiple_of(WIDTH_STEP));
    let columns = peaks.as_chunks_mut::<4>().0.iter_mut().zip(rows.as_chunks_mut::<4>().0);
    for (at, (peaks, rows)) in (0..).step_by(4).zip(columns) {
        // Rows are the inner loop, so that four peaks stay in registers.
        let mut peak = float32x4_t::splat(f32::NEG_INFINITY);
        let mut who = uint32x4_t::splat(0);
        for (row, values) in (0..).zip(values.chunks_exact(width)) {
            let four = values[at..].first_chunk().expect("invariant: whole vectors");
            let value = float32x4_t::load(four);
            // Strictly greater, so that the first of equal rows wins.
            let higher = value.exceeds(peak);
            peak = peak.replaced(higher, value);
            who = who.replaced(higher, uint32x4_t::splat(row));
        }
        peak.store(peaks);
        who.store(rows);
    }
}

fn above_floors(values: &[f32], floors: &[f32], found: &mut [Candidate]) -> Option<usize> {
    let width = floors.len();
    assert!(width.is_multiple_of(WIDTH_STEP));
    let mut n = 0;
    for (row, values) in values.chunks_exact(width).enumerate() {
        let batches = values.as_chunks::<BATCH>().0.iter().zip(floors.as_chunks::<BATCH>().0);
        for (batch, (values, floors)) in batches.enumerate() {
            // Candidates are rare, so one branch passes over most batches.
            if !any_above(values, floors) {
                continue;
            }
            for lane in (0..BATCH).filter(|&lane| values[lane] > floors[lane]) {
                let channel = (batch * BATCH + lane) as u16;
                *found.get_mut(n)? = Candidate { row: row as u16, channel };
                n += 1;
            }
        }
    }
    Some(n)
}

#[inline(always)]
fn any_above(values: &[f32; BATCH], floors: &[f32; BATCH]) -> bool {
    let ((values, _), (floors, _)) = (values.as_chunks(), floors.as_chunks());
    let above = |v: usize| float32x4_t::load(&values[v]).exceeds(Lanes::load(&floors[v]));
    // SAFETY: NEON is on every aarch64.
    unsafe {
        let any = vorrq_u32(vorrq_u32(above(0), above(1)), vorrq_u32(above(2), above(3)));
        vmaxvq_u32(any) != 0
    }
}

/// [`PrefilterKernels::dots`]: four sums, of every fourth vector each, hide the latency of FMLA.
fn dots(rows: &Rows<'_, f32>, weights: &[f32], candidates: &[Candidate], out: &mut [f32]) {
    let width = rows.stride();
    assert!(width.is_multiple_of(WIDTH_STEP));
    for (candidate, out) in candidates.iter().zip(out) {
        let row = &rows.data()[usize::from(candidate.row) * width..][..width];
        let weights = &weights[usize::from(candidate.channel) * width..][..width];
        let mut sums = [float32x4_t::splat(0.0); 4];
        for (a, w) in row.as_chunks::<16>().0.iter().zip(weights.as_chunks::<16>().0) {
            let ((a, _), (w, _)) = (a.as_chunks(), w.as_chunks());
            for (sum, (a, w)) in sums.iter_mut().zip(a.iter().zip(w)) {
                // SAFETY: NEON is on every aarch64.
                *sum = unsafe { vfmaq_f32(*sum, Lanes::load(a), Lanes::load(w)) };
            }
        }
        // SAFETY: NEON is on every aarch64.
        *out = unsafe {
            vaddvq_f32(vaddq_f32(vaddq_f32(sums[0], sums[1]), vaddq_f32(sums[2], sums[3])))
        };
    }
}
