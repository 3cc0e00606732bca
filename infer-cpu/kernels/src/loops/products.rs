//! Matrix products, stored or pooled.

use std::ops::Range;

use super::tile::Tile;
use super::{Lanes, V, Vector};
use crate::rows::holds_rows;
use crate::{Panels, Rows};

/// Runs `$body` for each tile, with `$r` rows as a constant: a full tile, or the remaining rows.
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

/// [`crate::Gemm::rows`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn rows<L: Lanes, T: Tile<L>>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    out: &mut [f32],
    out_stride: usize,
) {
    check::<L, T>(rows, weights, &panels);
    let width = weights.channels(&panels).end;
    assert!(holds_rows(out.len(), rows.n(), out_stride, width), "no room for the outputs");
    // The outer loop is over panels: a panel stays in the first-level cache while the rows, which
    // are fewer bytes, stream by.
    for panel in panels {
        let first = panel * weights.nr();
        let data = weights.panel(panel);
        for_tiles!(L, rows.n(), |row, R| {
            // SAFETY: `check` found `padded_inputs` activations in each row, and `holds_rows` room
            // for the channels of each row up to `width`.
            unsafe {
                let from = rows.data().as_ptr().add(row * rows.stride());
                let sums = T::sums::<R>(from, rows.stride(), data);
                for (r, sums) in sums.into_iter().enumerate() {
                    for (v, sums) in sums.into_iter().enumerate() {
                        let channel = first + v * L::N;
                        let value = finish(sums.to_float(), weights, channel);
                        value.store(out.as_mut_ptr().add((row + r) * out_stride + channel));
                    }
                }
            }
        });
    }
}

/// Asserts the conditions of the unsafe loops beyond the invariants of [`Rows`] and [`Panels`]:
/// rows are as wide as the panels, panels are packed for this tile, and the range of panels exists.
#[inline(always)]
fn check<L: Lanes, T: Tile<L>>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: &Range<usize>,
) {
    rows.check(weights.padded_inputs());
    assert!(
        weights.nr() == V * L::N && weights.padded_inputs().is_multiple_of(T::STEP),
        "panels packed for another kernel"
    );
    assert!(panels.end <= weights.n_panels(), "panels that are not there");
}

/// Applies scale, bias and ReLU of the channels from `channel` on.
///
/// # Safety
/// The instruction set of `L`; `channel` begins a vector of one of the panels.
#[inline(always)]
pub(super) unsafe fn finish<L: Lanes, W: Copy + Default>(
    value: L,
    weights: &Panels<W>,
    channel: usize,
) -> L {
    // SAFETY: `Panels` has `padded_outputs` biases, and as many scales if there are any, so that a
    // whole vector begins at `channel`.
    unsafe {
        let bias = L::load(weights.biases().as_ptr().add(channel));
        let value = if weights.scales().is_empty() {
            value.add(bias)
        } else {
            value.fma(L::load(weights.scales().as_ptr().add(channel)), bias)
        };
        if weights.relu { value.max(L::splat(0.0)) } else { value }
    }
}

/// [`crate::Gemm::max`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn max<L: Lanes, T: Tile<L>>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    maxima: &mut [<T::Sums as Vector>::Element],
) {
    check::<L, T>(rows, weights, &panels);
    assert!(maxima.len() == panels.len() * weights.nr(), "expected a maximum for each channel");
    for (panel, maxima) in panels.zip(maxima.chunks_exact_mut(V * L::N)) {
        let data = weights.panel(panel);
        // SAFETY: a chunk has V vectors, and `check` found `padded_inputs` activations in each row.
        unsafe {
            let mut best: [T::Sums; V] =
                std::array::from_fn(|v| T::Sums::load(maxima.as_ptr().add(v * L::N)));
            for_tiles!(L, rows.n(), |row, R| {
                let from = rows.data().as_ptr().add(row * rows.stride());
                // Maxima stay in registers over all rows: the products, a thousand a point, are
                // never stored.
                for sums in T::sums::<R>(from, rows.stride(), data) {
                    for v in 0..V {
                        best[v] = sums[v].max(best[v]);
                    }
                }
            });
            for (v, best) in best.into_iter().enumerate() {
                best.store(maxima.as_mut_ptr().add(v * L::N));
            }
        }
    }
}

/// [`crate::Gemm::argmax`].
///
/// # Safety
/// The instruction set of `L`.
#[inline(always)]
pub(crate) unsafe fn argmax<L: Lanes, T: Tile<L>>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    first_row: u32,
    maxima: &mut [<T::Sums as Vector>::Element],
    winners: &mut [u32],
) {
    check::<L, T>(rows, weights, &panels);
    assert!(
        maxima.len() == panels.len() * weights.nr() && winners.len() == maxima.len(),
        "expected a maximum and a winner for each channel"
    );
    let chunks = maxima.chunks_exact_mut(V * L::N).zip(winners.chunks_exact_mut(V * L::N));
    for (panel, (maxima, winners)) in panels.zip(chunks) {
        let data = weights.panel(panel);
        let winners = winners.as_mut_ptr().cast::<i32>();
        // SAFETY: a chunk has V vectors, and `check` found `padded_inputs` activations in each row.
        unsafe {
            let mut best: [T::Sums; V] =
                std::array::from_fn(|v| T::Sums::load(maxima.as_ptr().add(v * L::N)));
            let mut who: [L::Int; V] = std::array::from_fn(|v| L::Int::load(winners.add(v * L::N)));
            for_tiles!(L, rows.n(), |row, R| {
                let from = rows.data().as_ptr().add(row * rows.stride());
                let sums = T::sums::<R>(from, rows.stride(), data);
                for (r, sums) in sums.into_iter().enumerate() {
                    let index = L::Int::splat((first_row + (row + r) as u32) as i32);
                    for v in 0..V {
                        sums[v].keep_greater(&mut best[v], &mut who[v], index);
                    }
                }
            });
            for v in 0..V {
                best[v].store(maxima.as_mut_ptr().add(v * L::N));
                who[v].store(winners.add(v * L::N));
            }
        }
    }
}
