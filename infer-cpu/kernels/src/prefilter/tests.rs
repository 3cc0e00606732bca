use formats::rng::StreamKey;
use test_support::need;

use super::*;
use crate::available;
use crate::suite::{Bounded, F32, dot};

const ROWS: usize = 48;

/// Kernels with a prefilter; an error if this machine has none.
fn prefiltering_kernels() -> Result<&'static Kernels, String> {
    let found = available().find(|kernels| kernels.prefilters);
    found.ok_or_else(|| "this machine runs no kernels that prefilter".to_owned())
}

/// A layer, and its inputs in some blocks.
struct Case {
    layer: Dense,
    blocks: Vec<Vec<f32>>,
}

/// The inputs of every case: not a multiple of a vector's width.
const INPUTS: usize = 100;
const STRIDE: usize = 128;
const OUTPUTS: usize = 200;

fn case(kind: &str) -> Case {
    let key = StreamKey::new(3, kind, 0);
    let mut n = 0;
    let mut unit = || {
        n += 1;
        key.unit(n) as f32
    };
    let mut weight: Vec<f32> = (0..OUTPUTS * INPUTS).map(|_| 2.0 * unit() - 1.0).collect();
    let mut blocks: Vec<Vec<f32>> = (0..4).map(|_| vec![0.0; ROWS * STRIDE]).collect();
    for (b, block) in blocks.iter_mut().enumerate() {
        for (r, row) in block.chunks_exact_mut(STRIDE).enumerate() {
            for (k, x) in row[..INPUTS].iter_mut().enumerate() {
                *x = (unit() - 0.4).max(0.0)
                    * match kind {
                        "one row towers" if (b, r) == (2, 7) => 1e6,
                        "one input towers" if k == 3 => 1e4,
                        "large" => 1e12,
                        "tiny" => 1e-12,
                        "rows alike" => 0.0,
                        _ => 1.0,
                    };
                if kind == "rows alike" {
                    *x = (k % 5) as f32 + if r == 9 { 1e-6 } else { 0.0 };
                }
            }
        }
    }
    match kind {
        "one weight towers" => weight.iter_mut().step_by(INPUTS).for_each(|w| *w *= 20.0),
        "channels of zeros" => weight[..90 * INPUTS].fill(0.0),
        "channels of huge weights" => weight[..5 * INPUTS].iter_mut().for_each(|w| *w *= -1e36),
        "channels of denormals" => weight[..5 * INPUTS].iter_mut().for_each(|w| *w *= 1e-40),
        _ => {}
    }
    let bias = (0..OUTPUTS).map(|_| unit() - 0.5).collect();
    let name = kind.to_owned();
    let layer = Dense { name, inputs: INPUTS, outputs: OUTPUTS, weight, bias, relu: true };
    Case { layer, blocks }
}

const KINDS: [&str; 10] = [
    "ordinary",
    "one row towers",
    "one input towers",
    "one weight towers",
    "large",
    "tiny",
    "rows alike",
    "channels of zeros",
    "channels of denormals",
    "channels of huge weights",
];

/// A product in f64, with the magnitudes it sums.
fn exact(row: &[f32], weights: &[f32]) -> (f64, f64) {
    dot(row.iter().zip(weights).map(|(&x, &w)| (x.into(), w.into())))
}

/// The largest product of a channel, in f64, with the magnitudes it sums.
fn exact_maximum(case: &Case, output: usize) -> (f64, f64) {
    let weights = &case.layer.weight[output * INPUTS..][..INPUTS];
    let rows = case.blocks.iter().flat_map(|block| block.chunks_exact(STRIDE));
    let products = rows.map(|row| exact(row, weights));
    products.fold((f64::NEG_INFINITY, 0.0), |best, next| {
        (best.0.max(next.0), if next.0 > best.0 { next.1 } else { best.1 })
    })
}

/// Pools a case; `None` if the prefilter gave up.
fn pool(case: &Case, kernels: &Kernels, wants_winners: bool) -> Option<(Vec<f32>, Vec<u32>)> {
    let prefilter = Int8Prefilter::new(&case.layer, kernels).unwrap();
    let mut prefilter_scratch = PrefilterScratch::new(ROWS);
    let (mut all_maxima, mut all_winners) = (Vec::new(), Vec::new());
    for group in 0..OUTPUTS.div_ceil(GROUP) {
        let width = GROUP.min(OUTPUTS.next_multiple_of(WIDTH_STEP) - group * GROUP);
        let (mut maxima, mut winners) = (vec![0.0; width], vec![0; width]);
        prefilter.begin(group, wants_winners, &mut maxima);
        for (b, block) in case.blocks.iter().enumerate() {
            let rows = Rows::new(block, STRIDE, ROWS);
            let mut levels = Levels::with_room(block.len());
            assert!(levels.take(kernels, &rows));
            let first_row = (b * ROWS) as u32;
            let mut best = Best { maxima: &mut maxima, winners: &mut winners, first_row };
            if !prefilter.pool(kernels, group, (&rows, &levels), &mut prefilter_scratch, &mut best)
            {
                return None;
            }
        }
        let n = width.min(OUTPUTS - group * GROUP);
        all_maxima.extend(&maxima[..n]);
        all_winners.extend(&winners[..n]);
    }
    Some((all_maxima, all_winners))
}

/// The error bound of a product whose magnitudes sum to `sum`.
fn bound(sum: f64) -> f64 {
    F32::bound(INPUTS, sum)
}

#[test]
fn maxima_are_those_of_all_products() {
    let kernels = need!(prefiltering_kernels());
    for kind in KINDS {
        let case = case(kind);
        let Some((maxima, winners)) = pool(&case, kernels, true) else {
            // A very large value makes the levels coarse, and equal rows have equal estimates.
            let hopeless = ["one row towers", "one input towers", "rows alike"];
            assert!(hopeless.contains(&kind), "{kind}: gave up");
            continue;
        };
        for output in 0..OUTPUTS {
            let (exact, sum) = exact_maximum(&case, output);
            let found = f64::from(maxima[output]);
            assert!((found - exact).abs() <= bound(sum), "{kind}, {output}: {found}, {exact}");
            // The winner's own product is as large.
            let winner = winners[output] as usize;
            let row = &case.blocks[winner / ROWS][winner % ROWS * STRIDE..][..INPUTS];
            let weights = &case.layer.weight[output * INPUTS..][..INPUTS];
            let (own, _) = self::exact(row, weights);
            assert!((own - exact).abs() <= 2.0 * bound(sum), "{kind}, {output}: row {winner}");
        }
    }
}

#[test]
fn products_below_the_relu_are_skipped() {
    let kernels = need!(prefiltering_kernels());
    let mut case = case("ordinary");
    case.layer.bias.iter_mut().step_by(2).for_each(|bias| *bias = -1e4);
    let (maxima, _) = pool(&case, kernels, false).unwrap();
    for (output, (maximum, bias)) in maxima.into_iter().zip(&case.layer.bias).enumerate() {
        let (exact, sum) = exact_maximum(&case, output);
        let seen = (maximum + bias).max(0.0);
        let expected = (exact + f64::from(*bias)).max(0.0);
        let near = bound(sum + f64::from(bias.abs()));
        assert!((f64::from(seen) - expected).abs() <= near, "{output}: {seen}, {expected}");
    }
}

#[test]
fn the_first_of_equal_rows_wins() {
    let kernels = need!(prefiltering_kernels());
    let mut case = case("ordinary");
    let (_, before) = pool(&case, kernels, true).unwrap();
    // Copies of all rows, after the originals.
    let copies: Vec<_> =
        (0..ROWS).map(|r| case.blocks[0][r * STRIDE..][..STRIDE].to_vec()).collect();
    case.blocks.push(copies.into_iter().rev().flatten().collect());
    let (_, after) = pool(&case, kernels, true).unwrap();
    assert_eq!(before, after);
}

/// Prefiltering is only useful if it rules out most products of each channel.
#[test]
fn few_products_are_left() {
    let kernels = need!(prefiltering_kernels());
    let case = case("ordinary");
    let prefilter = Int8Prefilter::new(&case.layer, kernels).unwrap();
    let mut prefilter_scratch = PrefilterScratch::new(ROWS);
    let (mut maxima, mut winners) = (vec![0.0; GROUP], vec![0; GROUP]);
    prefilter.begin(0, true, &mut maxima);
    let rows = Rows::new(&case.blocks[0], STRIDE, ROWS);
    let mut levels = Levels::with_room(ROWS * STRIDE);
    assert!(levels.take(kernels, &rows));
    let mut best = Best { maxima: &mut maxima, winners: &mut winners, first_row: 0 };
    assert!(prefilter.pool(kernels, 0, (&rows, &levels), &mut prefilter_scratch, &mut best));
    let left = prefilter_scratch.estimates.iter().zip(prefilter_scratch.floors.iter().cycle());
    let left = left.filter(|(estimate, floor)| estimate > floor).count();
    // Measured: 1 in 50 besides the peaks.
    assert!(left < ROWS * GROUP / 20, "{left}");
}

#[test]
fn levels_of_extreme_activations_are_refused() {
    let kernels = need!(prefiltering_kernels());
    let mut levels = Levels::with_room(STRIDE);
    let mut takes = |value: f32| {
        let mut row = [0.0; STRIDE];
        row[70] = value;
        levels.take(kernels, &Rows::new(&row, STRIDE, 1))
    };
    assert!(takes(1.0) && takes(1e-14) && takes(1e14));
    for value in [0.0, -1.0, 1e-20, 1e20, f32::INFINITY, f32::NAN, f32::NEG_INFINITY] {
        assert!(!takes(value), "{value}");
    }
}
