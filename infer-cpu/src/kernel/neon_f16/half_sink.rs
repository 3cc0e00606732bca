//! Sinks of sums that are still fp16.

use std::arch::aarch64::*;

use super::super::neon::sink::{ArgMax, Finish, Max, Sink};

/// Takes sums that are still fp16. A maximum over rows promotes only the largest.
pub trait HalfSink {
    /// Takes the next `R` rows.
    ///
    /// # Safety
    /// As for [`Sink::take`]; the machine has FEAT_FP16.
    unsafe fn take_half<const R: usize>(&mut self, sums: &[[float16x8_t; 2]; R]);
}

impl HalfSink for Finish<4> {
    #[inline]
    #[target_feature(enable = "neon,fp16")]
    unsafe fn take_half<const R: usize>(&mut self, sums: &[[float16x8_t; 2]; R]) {
        for sums in sums {
            // SAFETY: `Finish::new` asserted room for all rows of the `Strip`, of which this is one.
            unsafe { self.take([promoted(sums)]) };
        }
    }
}

impl HalfSink for Max<float32x4_t, 4> {
    #[inline]
    #[target_feature(enable = "neon,fp16")]
    unsafe fn take_half<const R: usize>(&mut self, sums: &[[float16x8_t; 2]; R]) {
        // SAFETY: `Max` writes only to itself, so that any number of rows is allowed.
        unsafe { self.take([promoted(&largest(sums))]) }
    }
}

impl HalfSink for ArgMax<float32x4_t, 4> {
    #[inline]
    #[target_feature(enable = "neon,fp16")]
    unsafe fn take_half<const R: usize>(&mut self, sums: &[[float16x8_t; 2]; R]) {
        let largest = largest(sums);
        let mut rows = [vdupq_n_u16(0); 2];
        for (row, sums) in sums.iter().enumerate().rev() {
            for v in 0..2 {
                let equal = vceqq_f16(sums[v], largest[v]);
                rows[v] = vbslq_u16(equal, vdupq_n_u16(row as u16), rows[v]);
            }
        }
        let [left, right] = rows;
        let rows = [
            vmovl_u16(vget_low_u16(left)),
            vmovl_high_u16(left),
            vmovl_u16(vget_low_u16(right)),
            vmovl_high_u16(right),
        ];
        self.merge(promoted(&largest), rows, R);
    }
}

/// Adds up the sums of a tile's blocks.
pub struct Blocks<const ROWS: usize> {
    pub sums: [[float32x4_t; 4]; ROWS],
}

impl<const ROWS: usize> HalfSink for Blocks<ROWS> {
    #[inline]
    #[target_feature(enable = "neon,fp16")]
    unsafe fn take_half<const R: usize>(&mut self, sums: &[[float16x8_t; 2]; R]) {
        for (sums, block) in self.sums.iter_mut().zip(sums) {
            let block = promoted(block);
            for (sum, block) in sums.iter_mut().zip(block) {
                *sum = vaddq_f32(*sum, block);
            }
        }
    }
}

/// The largest of each column; NaN only if all are NaN.
#[inline]
#[target_feature(enable = "neon,fp16")]
fn largest<const R: usize>(sums: &[[float16x8_t; 2]; R]) -> [float16x8_t; 2] {
    let mut largest = sums[0];
    for sums in &sums[1..] {
        largest[0] = vmaxnmq_f16(largest[0], sums[0]);
        largest[1] = vmaxnmq_f16(largest[1], sums[1]);
    }
    largest
}

/// The same numbers in fp32.
#[inline]
#[target_feature(enable = "neon")]
fn promoted([left, right]: &[float16x8_t; 2]) -> [float32x4_t; 4] {
    [
        vcvt_f32_f16(vget_low_f16(*left)),
        vcvt_high_f32_f16(*left),
        vcvt_f32_f16(vget_low_f16(*right)),
        vcvt_high_f32_f16(*right),
    ]
}
