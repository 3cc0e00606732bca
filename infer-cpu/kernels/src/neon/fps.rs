//! One step of farthest point sampling.
//!
//! Distances are lowered four at a time with a running maximum. Its position is tracked as a block
//! of 64 points, which is then searched.

use std::arch::aarch64::*;

use super::lanes::{Lanes, Sums};
use crate::table::Soa;

/// Points of a block.
const BLOCK: usize = 64;

/// [`Kernels::fps_step`](super::super::Kernels::fps_step).
pub fn step(cloud: Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize {
    let pick = pick.map(float32x4_t::splat);
    let n = distance.len();
    let ((x, x_rest), (y, y_rest), (z, z_rest)) =
        (cloud.x[..n].as_chunks(), cloud.y[..n].as_chunks(), cloud.z[..n].as_chunks());
    let mut farthest = Farthest::none();
    let (blocks, rest) = distance.as_chunks_mut();
    let n_blocks = blocks.len();
    for (block, (((x, y), z), distance)) in x.iter().zip(y).zip(z).zip(blocks).enumerate() {
        farthest.take(block, lower([x, y, z], pick, distance));
    }
    if !rest.is_empty() {
        // Padding has a distance below all others, so that it is never the farthest.
        let mut last = filled(rest, -1.0);
        let [x, y, z] = [x_rest, y_rest, z_rest].map(|axis| filled(axis, 0.0));
        farthest.take(n_blocks, lower([&x, &y, &z], pick, &mut last));
        rest.copy_from_slice(&last[..rest.len()]);
    }
    farthest.find(distance)
}

/// The last block, padded.
fn filled(rest: &[f32], padding: f32) -> [f32; BLOCK] {
    let mut block = [padding; BLOCK];
    block[..rest.len()].copy_from_slice(rest);
    block
}

/// Lowers a block's distances to those from `pick` and returns the maximum of each lane.
#[inline(always)]
fn lower(
    points: [&[f32; BLOCK]; 3],
    pick: [float32x4_t; 3],
    distance: &mut [f32; BLOCK],
) -> float32x4_t {
    let [x, y, z] = points.map(|axis| axis.as_chunks().0);
    let (distance, _) = distance.as_chunks_mut();
    let mut largest = float32x4_t::splat(-1.0);
    for (((x, y), z), distance) in x.iter().zip(y).zip(z).zip(distance) {
        // SAFETY: NEON is on every aarch64.
        unsafe {
            let dx = vsubq_f32(Lanes::load(x), pick[0]);
            let dy = vsubq_f32(Lanes::load(y), pick[1]);
            let dz = vsubq_f32(Lanes::load(z), pick[2]);
            let squared = vaddq_f32(vmulq_f32(dx, dx), vmulq_f32(dy, dy));
            let squared = vaddq_f32(squared, vmulq_f32(dz, dz));
            // FMINNM keeps the distance where the square is NaN.
            let lowered = vminnmq_f32(Lanes::load(distance), squared);
            lowered.store(distance);
            largest = largest.larger(lowered);
        }
    }
    largest
}

/// The farthest distance in each lane, and its block.
struct Farthest {
    distance: float32x4_t,
    block: uint32x4_t,
}

impl Farthest {
    fn none() -> Self {
        Self { distance: float32x4_t::splat(-1.0), block: uint32x4_t::splat(0) }
    }

    #[inline(always)]
    fn take(&mut self, block: usize, largest: float32x4_t) {
        let raised = largest.exceeds(self.distance);
        self.distance = self.distance.replaced(raised, largest);
        self.block = self.block.replaced(raised, uint32x4_t::splat(block as u32));
    }

    /// The first of the farthest points.
    fn find(&self, distance: &[f32]) -> usize {
        // SAFETY: NEON is on every aarch64.
        let (largest, first) = unsafe {
            let largest = vmaxnmvq_f32(self.distance);
            let farthest = vceqq_f32(self.distance, float32x4_t::splat(largest));
            let blocks = uint32x4_t::splat(u32::MAX).replaced(farthest, self.block);
            (largest, vminvq_u32(blocks) as usize * BLOCK)
        };
        let block = distance.iter().skip(first);
        first + block.take_while(|&&distance| distance != largest).count()
    }
}
