//! What every kernel must do: the same as exact arithmetic, to a bound that
//! follows from the number of inputs and the format, on sizes around every
//! tile and on values at every extreme.
//!
//! [`suite`] makes the tests of one file of kernels; `declare_kernels` calls
//! it. A machine without the instructions skips them.

use std::panic::{AssertUnwindSafe, catch_unwind};

use formats::rng::StreamKey;
use half::f16;

use super::scalar::{F16_BLOCK, F16_CHUNK};
use super::{Candidate, Columns, Gemm, I8_LARGEST, Kernels, Panels, Rows, Soa, WIDTH_STEP};

/// Numbers of rows: none, and around every tile height in use (4, 6, 8, 12).
const ROWS: [usize; 12] = [0, 1, 3, 5, 6, 7, 8, 9, 10, 12, 13, 29];
/// Numbers of inputs: around every unrolling in use (4, 8, 16, 32).
const INPUTS: [usize; 13] = [1, 2, 3, 4, 5, 8, 15, 16, 17, 31, 33, 64, 130];
const OUTPUTS: [usize; 4] = [1, 31, 64, 65];

/// What the numbers of a problem are like.
#[derive(Clone, Copy, Debug)]
pub enum Values {
    /// Uniform in -1..1.
    Ordinary,
    /// Large terms that cancel to small sums.
    Cancelling,
    /// Denormal weights.
    Denormal,
    /// NaN and infinities among them.
    NotFinite,
}

pub const VALUES: [Values; 4] =
    [Values::Ordinary, Values::Cancelling, Values::Denormal, Values::NotFinite];

/// Numbers drawn by rule.
struct Draw {
    key: StreamKey,
    n: u64,
}

impl Draw {
    fn new(name: &str) -> Self {
        Self { key: StreamKey::new(3, name, 0), n: 0 }
    }

    /// Uniform in -1..1.
    fn signed(&mut self) -> f32 {
        self.n += 1;
        (2.0 * self.key.unit(self.n) - 1.0) as f32
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.n += 1;
        self.key.below(bound, self.n)
    }

    /// An element of a problem; `smallest` is the format's least normal number.
    fn element(&mut self, values: Values, at: usize, smallest: f32) -> f32 {
        let x = self.signed();
        match values {
            Values::Ordinary => x,
            Values::Cancelling if at.is_multiple_of(2) => 30.0 + x * 0.01,
            Values::Cancelling => -30.0 + x * 0.01,
            Values::Denormal => x * smallest,
            Values::NotFinite => match self.below(40) {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => f32::NEG_INFINITY,
                _ => x,
            },
        }
    }
}

/// A format's numbers, and the bound of its rounding errors.
pub trait Number: Copy + Default + PartialEq + std::fmt::Debug {
    /// The nearest number of this format.
    fn round(value: f32) -> Self;
    /// The number.
    fn wide(self) -> f64;
    /// Least normal magnitude.
    const SMALLEST: f32;
    /// How far a dot product of `k` terms whose magnitudes sum to `sum` may be
    /// off.
    fn bound(k: usize, sum: f64) -> f64;
}

/// Unit roundoff of f32.
const U32: f64 = 1.0 / (1u64 << 24) as f64;
/// Unit roundoff of f16.
const U16: f64 = 1.0 / (1u64 << 11) as f64;

impl Number for f32 {
    fn round(value: f32) -> Self {
        value
    }

    fn wide(self) -> f64 {
        f64::from(self)
    }

    const SMALLEST: f32 = f32::MIN_POSITIVE;

    /// Any order of k steps, fused or not, a scale and a bias: (k + 2) u of the
    /// sum of magnitudes to first order (Higham 2002, §3.1), one more for the
    /// second order; half a denormal a step, once for the product and once for
    /// the sum, where numbers are that small.
    fn bound(k: usize, sum: f64) -> f64 {
        (k + 3) as f64 * (U32 * sum + 2f64.powi(-149))
    }
}

impl Number for f16 {
    fn round(value: f32) -> Self {
        Self::from_f32(value)
    }

    fn wide(self) -> f64 {
        self.to_f64()
    }

    const SMALLEST: f32 = 6.103_515_6e-5;

    /// The bound of [`F16_BLOCK`], one more for the second order; half a
    /// denormal of fp16 (2⁻²⁵) a step where numbers are that small; the sum of
    /// blocks in f32.
    fn bound(k: usize, sum: f64) -> f64 {
        let roundings = F16_CHUNK.min(k) + F16_BLOCK.min(k).div_ceil(F16_CHUNK);
        let block = roundings as f64 * U16 * sum;
        block + k as f64 * 2f64.powi(-25) + f32::bound(k / F16_BLOCK + 3, sum)
    }
}

/// A matrix product with its exact answers.
struct Problem<A, W> {
    activations: Vec<A>,
    n: usize,
    stride: usize,
    weights: Panels<W>,
    /// Row by row: dot product, sum of magnitudes.
    exact: Vec<(f64, f64)>,
}

impl<A: Copy, W> Problem<A, W> {
    fn rows(&self) -> Rows<'_, A> {
        Rows::new(&self.activations, self.stride, self.n)
    }
}

fn float_problem<T: Number>(
    gemm: &Gemm<T, T, f32>,
    (n, inputs, outputs): (usize, usize, usize),
    values: Values,
) -> Problem<T, T> {
    let mut draw = Draw::new(&format!("{n} {inputs} {outputs} {values:?}"));
    let mut weights = Panels::zeros(inputs, outputs, (gemm.nr, gemm.k_step, 1));
    let plain: Vec<T> = (0..inputs * outputs)
        .map(|i| T::round(draw.element(values, i / outputs, T::SMALLEST)))
        .collect();
    weights.fill(|input, output| plain[input * outputs + output]);
    // A stride of its own: padding of the panels' inputs and some more.
    let stride = weights.padded_inputs() + 4;
    let mut activations = vec![T::default(); n * stride];
    for row in activations.chunks_exact_mut(stride) {
        for a in &mut row[..inputs] {
            // Beside denormal weights, activations of 1: products that stay.
            let kind = if matches!(values, Values::Denormal) { Values::Ordinary } else { values };
            *a = T::round(draw.element(kind, 0, 1.0));
        }
    }
    let exact = (0..n * outputs)
        .map(|i| {
            let row = &activations[i / outputs * stride..][..inputs];
            let terms = row.iter().enumerate();
            let terms = terms.map(|(k, a)| a.wide() * plain[k * outputs + i % outputs].wide());
            terms.fold((0.0, 0.0), |(dot, sum), term| (dot + term, sum + term.abs()))
        })
        .collect();
    Problem { activations, n, stride, weights, exact }
}

fn assert_near(found: f32, exact: f64, bound: f64, place: impl std::fmt::Debug) {
    if exact.is_finite() {
        assert!((f64::from(found) - exact).abs() <= bound, "{place:?}: {found} for {exact}");
    } else {
        let same =
            found.is_nan() == exact.is_nan() && (exact.is_nan() || f64::from(found) == exact);
        assert!(same, "{place:?}: {found} for {exact}");
    }
}

/// Calls `check` with every size and kind of values.
fn for_each_problem(mut check: impl FnMut((usize, usize, usize), Values)) {
    for values in VALUES {
        for n in ROWS {
            for inputs in INPUTS {
                for outputs in OUTPUTS {
                    check((n, inputs, outputs), values);
                }
            }
        }
    }
}

/// That products are exact to the format's bound.
pub fn float_rows_are_near_exact<T: Number>(gemm: &Gemm<T, T, f32>) {
    for_each_problem(|size, values| {
        let problem = float_problem(gemm, size, values);
        let width = problem.weights.padded_outputs();
        let mut out = vec![7.0; size.0 * width];
        let panels = 0..problem.weights.n_panels();
        (gemm.rows)(&problem.rows(), &problem.weights, panels, &mut out, width);
        for (i, &(dot, sum)) in problem.exact.iter().enumerate() {
            let (row, output) = (i / size.2, i % size.2);
            let place = (size, values, row, output);
            assert_near(out[row * width + output], dot, T::bound(size.1, sum), place);
        }
    });
}

/// That scale, bias and ReLU are applied in this order, to every channel.
pub fn float_rows_are_finished<T: Number>(gemm: &Gemm<T, T, f32>) {
    let size = (13, 17, 65);
    let mut problem = float_problem(gemm, size, Values::Ordinary);
    let width = problem.weights.padded_outputs();
    for output in 0..width {
        problem.weights.scales_mut()[output] = 0.5 + output as f32;
        problem.weights.biases_mut()[output] = 3.0 - output as f32;
    }
    for relu in [false, true] {
        problem.weights.set_relu(relu);
        let mut out = vec![7.0; size.0 * width];
        let panels = 0..problem.weights.n_panels();
        (gemm.rows)(&problem.rows(), &problem.weights, panels, &mut out, width);
        for (i, &(dot, sum)) in problem.exact.iter().enumerate() {
            let (row, output) = (i / size.2, i % size.2);
            let (scale, bias) = (0.5 + output as f64, 3.0 - output as f64);
            let exact = dot * scale + bias;
            let exact = if relu { exact.max(0.0) } else { exact };
            let bound = T::bound(size.1, sum) * scale + f32::bound(3, bias.abs() + sum * scale);
            assert_near(out[row * width + output], exact, bound, (row, output, relu));
        }
    }
}

/// That maxima and their rows are those of the products, to the bit, of the
/// first row among equals, whatever the place of a row in its tile.
pub fn float_maxima_are_those_of_the_rows<T: Number>(gemm: &Gemm<T, T, f32>) {
    for_each_problem(|size, values| {
        let mut problem = float_problem(gemm, size, values);
        // Some rows twice: ties.
        for row in (2..size.0).step_by(3) {
            problem.activations.copy_within(0..problem.stride, row * problem.stride);
        }
        let width = problem.weights.padded_outputs();
        let panels = 0..problem.weights.n_panels();
        let mut out = vec![0.0; size.0 * width];
        (gemm.rows)(&problem.rows(), &problem.weights, panels.clone(), &mut out, width);
        let (mut maxima, mut winners) = (vec![f32::NEG_INFINITY; width], vec![u32::MAX; width]);
        let mut alone = maxima.clone();
        (gemm.max)(&problem.rows(), &problem.weights, panels.clone(), &mut alone);
        (gemm.argmax)(&problem.rows(), &problem.weights, panels, 100, &mut maxima, &mut winners);
        for output in 0..size.2 {
            let column = (0..size.0).map(|row| out[row * width + output]);
            let (largest, winner) =
                column.zip(100u32..).fold((f32::NEG_INFINITY, u32::MAX), |best, next| {
                    if next.0 > best.0 { next } else { best }
                });
            let place = (size, values, output);
            assert_eq!((maxima[output], winners[output]), (largest, winner), "{place:?}");
            assert_eq!(alone[output], largest, "{place:?}");
        }
    });
}

/// That a range of panels touches its own channels and no others.
pub fn a_range_of_panels_is_its_own<T: Number>(gemm: &Gemm<T, T, f32>) {
    let problem = float_problem(gemm, (13, 17, 65), Values::Ordinary);
    let width = problem.weights.padded_outputs();
    let n_panels = problem.weights.n_panels();
    let mut whole = vec![0.0; 13 * width];
    (gemm.rows)(&problem.rows(), &problem.weights, 0..n_panels, &mut whole, width);
    let mut parts = vec![7.0; 13 * width];
    for panel in (0..n_panels).rev() {
        (gemm.rows)(&problem.rows(), &problem.weights, panel..panel + 1, &mut parts, width);
    }
    assert_eq!(whole, parts);
    let mut maxima = vec![f32::NEG_INFINITY; width];
    (gemm.max)(&problem.rows(), &problem.weights, 0..n_panels, &mut maxima);
    for panel in 0..n_panels {
        let channels = problem.weights.channels(&(panel..panel + 1));
        let mut some = vec![f32::NEG_INFINITY; channels.len()];
        (gemm.max)(&problem.rows(), &problem.weights, panel..panel + 1, &mut some);
        assert_eq!(some, maxima[channels]);
    }
}

/// That integer products are exact, maxima and rows as well.
pub fn integers_are_exact(gemm: &Gemm<u8, i8, i32>) {
    for n in ROWS {
        for inputs in INPUTS {
            for (outputs, extreme) in [(1, false), (31, true), (64, false), (65, true)] {
                integer_case(gemm, (n, inputs, outputs), extreme);
            }
        }
    }
}

fn integer_case(gemm: &Gemm<u8, i8, i32>, size: (usize, usize, usize), extreme: bool) {
    let (n, inputs, outputs) = size;
    let mut draw = Draw::new(&format!("i8 {size:?}"));
    let mut weights = Panels::zeros(inputs, outputs, (gemm.nr, gemm.k_step, 4));
    let mut level = |largest: i32| match extreme {
        true => largest,
        false => draw.below(largest as u64 + 1) as i32,
    };
    let plain: Vec<i8> = (0..inputs * outputs)
        .map(|i| (level(127) * if i % 3 == 0 { -1 } else { 1 }) as i8)
        .collect();
    weights.fill(|input, output| plain[input * outputs + output]);
    let stride = weights.padded_inputs() + 4;
    let mut activations = vec![0u8; n * stride];
    for row in activations.chunks_exact_mut(stride) {
        row[..inputs].fill_with(|| level(i32::from(I8_LARGEST)) as u8);
    }
    let rows = Rows::new(&activations, stride, n);
    let width = weights.padded_outputs();
    let panels = 0..weights.n_panels();
    let mut out = vec![7.0; n * width];
    (gemm.rows)(&rows, &weights, panels.clone(), &mut out, width);
    let (mut maxima, mut winners) = (vec![i32::MIN; width], vec![u32::MAX; width]);
    (gemm.argmax)(&rows, &weights, panels.clone(), 5, &mut maxima, &mut winners);
    let mut alone = vec![i32::MIN; width];
    (gemm.max)(&rows, &weights, panels, &mut alone);
    for output in 0..outputs {
        let mut best = (i32::MIN, u32::MAX);
        for row in 0..n {
            let terms = (0..inputs).map(|k| {
                i32::from(activations[row * stride + k]) * i32::from(plain[k * outputs + output])
            });
            let dot: i32 = terms.sum();
            // Below 2^24, so exact in f32.
            assert_eq!(out[row * width + output], dot as f32, "{size:?} {row} {output}");
            if dot > best.0 {
                best = (dot, 5 + row as u32);
            }
        }
        assert_eq!((maxima[output], winners[output]), best, "{size:?} {output}");
        assert_eq!(alone[output], best.0, "{size:?} {output}");
    }
}

/// That dot products with columns are exact to the bound of f32, and columns
/// of inputs left out are not read.
pub fn gemv_is_near_exact(kernels: &Kernels) {
    for inputs in [0, 1, 2, 3, 7, 64, 257] {
        for outputs in [1, 9, 63, 64, 65, 200] {
            let mut draw = Draw::new(&format!("gemv {inputs} {outputs}"));
            let plain: Vec<i8> =
                (0..inputs * outputs).map(|_| (draw.signed() * 127.0) as i8).collect();
            let nonzero: Vec<(u32, f32)> = (0..inputs as u32)
                .filter(|j| j % 3 != 1)
                .map(|j| (j, draw.signed() * 10.0))
                .collect();
            let mut f32s = Columns::<f32>::zeros(inputs, outputs);
            let mut f16s = Columns::<f16>::zeros(inputs, outputs);
            let mut i8s = Columns::<i8>::zeros(inputs, outputs);
            let weight = |j: usize, o: usize| match j % 3 {
                1 => f32::NAN,
                _ => f32::from(plain[j * outputs + o]),
            };
            f32s.fill(weight);
            f16s.fill(|j, o| f16::from_f32(weight(j, o)));
            i8s.fill(|j, o| plain[j * outputs + o]);
            let width = f32s.padded_outputs();
            for biases in [f32s.biases_mut(), f16s.biases_mut(), i8s.biases_mut()] {
                (0..width).for_each(|o| biases[o] = o as f32);
            }
            i8s.scales_mut().fill(0.25);
            let blocks = 0..f32s.n_blocks();
            let mut found = [vec![7.0; width], vec![7.0; width], vec![7.0; width]];
            (kernels.gemv_f32)(&nonzero, &f32s, blocks.clone(), &mut found[0]);
            (kernels.gemv_f16)(&nonzero, &f16s, blocks.clone(), &mut found[1]);
            (kernels.gemv_i8)(&nonzero, &i8s, blocks, &mut found[2]);
            for o in 0..outputs {
                let terms = nonzero.iter();
                let terms =
                    terms.map(|&(j, v)| f64::from(v) * f64::from(plain[j as usize * outputs + o]));
                let (dot, sum) = terms.fold((0.0, 0.0), |(d, s), t| (d + t, s + f64::abs(t)));
                let bound = f32::bound(inputs, sum + o as f64);
                for (found, scale) in found.iter().zip([1.0, 1.0, 0.25]) {
                    assert_near(found[o], dot * scale + o as f64, bound, (inputs, outputs, o));
                }
            }
        }
    }
}

/// That narrowing does what the reference does, to the bit.
pub fn narrowing_is_the_reference(kernels: &Kernels) {
    let reference = super::scalar::kernels().unwrap();
    let mut draw = Draw::new("narrow");
    for n in [0, 1, 7, 8, 15, 16, 17, 64, 100] {
        let mut values: Vec<f32> = (0..n).map(|_| draw.signed() * 100.0).collect();
        let extremes = [70000.0, -70000.0, 1e-8, -0.0, 65519.9, 65520.0, 0.5, 1.5, 126.6, 127.6];
        for (value, extreme) in values.iter_mut().zip(extremes) {
            *value = extreme;
        }
        let (mut found, mut expected) = (vec![f16::ONE; n], vec![f16::ZERO; n]);
        let largest = (kernels.narrow_f16)(&values, &mut found);
        assert_eq!(largest, (reference.narrow_f16)(&values, &mut expected));
        assert_eq!(found, expected, "{n}");
        let (mut found, mut expected) = (vec![9u8; n], vec![0u8; n]);
        for per_unit in [1.0, 0.37] {
            let clipped = (kernels.narrow_i8)(&values, per_unit, &mut found);
            assert_eq!(clipped, (reference.narrow_i8)(&values, per_unit, &mut expected));
            assert_eq!(found, expected, "{n}");
        }
    }
}

/// That levels are those of the reference, and sums of squares near them: of `n`
/// steps each, fused or not (Higham 2002, §3.1).
pub fn levels_are_the_reference(kernels: &Kernels) {
    let reference = super::scalar::kernels().unwrap();
    let mut draw = Draw::new("levels");
    for n in [WIDTH_STEP, 2 * WIDTH_STEP, 5 * WIDTH_STEP] {
        let mut row: Vec<f32> = (0..n).map(|_| draw.signed().max(0.0) * 130.0).collect();
        row[..6].copy_from_slice(&[0.0, -0.0, 0.5, 1.5, 127.5, 1e9]);
        for per_unit in [1.0, 0.37, 0.0] {
            let (mut found, mut expected) = (vec![9u8; n], vec![0u8; n]);
            let sums = (kernels.prefilter.levels)(&row, per_unit, &mut found);
            let exact = (reference.prefilter.levels)(&row, per_unit, &mut expected);
            assert_eq!(found, expected, "{n}");
            let near = |a: f32, b: f32| (a - b).abs() <= n as f32 * f32::EPSILON * b;
            assert!(near(sums.lost, exact.lost), "{sums:?}, {exact:?}");
            assert!(near(sums.squares, exact.squares), "{sums:?}, {exact:?}");
        }
    }
}

/// That peaks are those of the reference, first rows among equals, and that
/// what is above a floor is found, in order, or nothing where room is short.
pub fn candidates_are_those_of_the_reference(kernels: &Kernels) {
    let reference = super::scalar::kernels().unwrap();
    let mut draw = Draw::new("above_floors");
    for (n, width) in [(0, 64), (1, 64), (7, 128), (48, 128)] {
        // A coarse grid, for ties.
        let mut values: Vec<f32> = (0..n * width).map(|_| (draw.signed() * 9.0).round()).collect();
        values.iter_mut().step_by(17).for_each(|value| *value = f32::NEG_INFINITY);
        let (mut peaks, mut rows) = (vec![7.0; width], vec![7; width]);
        let (mut expected_peaks, mut expected_rows) = (vec![0.0; width], vec![0; width]);
        (kernels.prefilter.peaks)(&values, &mut peaks, &mut rows);
        (reference.prefilter.peaks)(&values, &mut expected_peaks, &mut expected_rows);
        assert_eq!((&peaks, &rows), (&expected_peaks, &expected_rows));
        let mut floors: Vec<f32> = (0..width).map(|_| (draw.signed() * 9.0).round()).collect();
        floors[..3].copy_from_slice(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        let mut expected = vec![Candidate::default(); n * width];
        let count = (reference.prefilter.above_floors)(&values, &floors, &mut expected).unwrap();
        let mut found = vec![Candidate::default(); count];
        assert_eq!((kernels.prefilter.above_floors)(&values, &floors, &mut found), Some(count));
        assert_eq!(found, expected[..count]);
        if count > 0 {
            let short = &mut found[..count - 1];
            assert_eq!((kernels.prefilter.above_floors)(&values, &floors, short), None);
        }
    }
}

/// That single products are exact to the bound of fp32, wherever they are.
pub fn dots_are_near_exact(kernels: &Kernels) {
    let mut draw = Draw::new("dots");
    for values in [Values::Ordinary, Values::Cancelling, Values::Denormal, Values::NotFinite] {
        for width in [WIDTH_STEP, 3 * WIDTH_STEP] {
            let (n, channels) = (5, 7);
            let kind = if matches!(values, Values::Denormal) { Values::Ordinary } else { values };
            let data: Vec<f32> = (0..n * width).map(|_| draw.element(kind, 0, 1.0)).collect();
            let weights: Vec<f32> =
                (0..channels * width).map(|i| draw.element(values, i, f32::MIN_POSITIVE)).collect();
            let all = (0..n * channels).rev();
            let candidates: Vec<Candidate> = all
                .map(|i| Candidate { row: (i / channels) as u16, channel: (i % channels) as u16 })
                .collect();
            let mut out = vec![7.0; candidates.len()];
            let rows = Rows::new(&data, width, n);
            (kernels.prefilter.dots)(&rows, &weights, &candidates, &mut out);
            for (candidate, out) in candidates.iter().zip(out) {
                let of = |data: &[f32], at: u16| data[usize::from(at) * width..][..width].to_vec();
                let (row, weights) = (of(&data, candidate.row), of(&weights, candidate.channel));
                let terms = row.iter().zip(&weights).map(|(a, w)| a.wide() * w.wide());
                let (dot, sum) =
                    terms.fold((0.0, 0.0), |(dot, sum), term| (dot + term, sum + term.abs()));
                assert_near(out, dot, f32::bound(width, sum), (values, width, candidate));
            }
        }
    }
}

/// That farthest point sampling picks what the reference picks and leaves the
/// same distances, to the bit, ties included.
pub fn fps_is_the_reference(kernels: &Kernels) {
    let reference = super::scalar::kernels().unwrap();
    for n in [1, 2, 3, 4, 5, 7, 8, 15, 16, 17, 31, 33, 64, 100, 1000] {
        let mut draw = Draw::new("fps");
        // Coordinates on a coarse grid, for ties.
        let mut axis = || (0..n).map(|_| (draw.signed() * 4.0).round()).collect::<Vec<f32>>();
        let (x, y, z) = (axis(), axis(), axis());
        let cloud = Soa { x: &x, y: &y, z: &z };
        let (mut found, mut expected) = (vec![f32::INFINITY; n], vec![f32::INFINITY; n]);
        let mut pick = 0;
        for _ in 0..n.min(20) {
            let at = [x[pick], y[pick], z[pick]];
            let next = (kernels.fps_step)(cloud, at, &mut found);
            pick = (reference.fps_step)(cloud, at, &mut expected);
            assert_eq!((next, &found), (pick, &expected), "{n}");
        }
    }
}

/// Products that a set of kernels may leave to another set.
pub fn products<G>(gemm: Option<&G>) -> Result<&G, String> {
    gemm.ok_or_else(|| "this set of kernels leaves these products to another".to_owned())
}

/// That `work` panics with a message that contains `words`.
pub fn panics_with<T>(words: &str, work: impl FnOnce() -> T) {
    let panic = catch_unwind(AssertUnwindSafe(|| drop(work()))).expect_err("it goes through");
    let message = panic.downcast_ref::<String>().map(String::as_str);
    let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or_default();
    assert!(message.contains(words), "expected a message with `{words}`, found `{message}`");
}

/// That operands of which a kernel would read or write beyond the end are refused.
pub fn operands_that_do_not_fit_are_refused<A, W, C>(gemm: &Gemm<A, W, C>, group: usize)
where
    A: Copy + Default,
    W: Copy + Default,
    C: Copy + Default,
{
    let panels = Panels::<W>::zeros(2 * gemm.k_step, WIDTH_STEP, (gemm.nr, gemm.k_step, group));
    let all = 0..panels.n_panels();
    let k = panels.padded_inputs();
    let data = vec![A::default(); 3 * k];
    let rows = Rows::new(&data, k, 3);
    let mut out = vec![0.0; 3 * WIDTH_STEP];
    // The last row ends too early.
    let short = Rows::new(&data[..3 * k - 1], k, 3);
    panics_with("rows end before their width", || {
        (gemm.rows)(&short, &panels, all.clone(), &mut out, WIDTH_STEP);
    });
    // Outputs of the last row have no room, or rows of outputs overlap.
    for (len, stride) in [(3 * WIDTH_STEP - 1, WIDTH_STEP), (3 * WIDTH_STEP, usize::MAX / 2 + 1)] {
        panics_with("", || (gemm.rows)(&rows, &panels, all.clone(), &mut out[..len], stride));
    }
    // Inputs that are no whole steps of the kernel's loop.
    if gemm.k_step > group {
        let odd = Panels::<W>::zeros(2 * gemm.k_step - group, WIDTH_STEP, (gemm.nr, group, group));
        let width = odd.padded_inputs();
        let rows = Rows::new(&data[..width], width, 1);
        let mut maxima = vec![C::default(); WIDTH_STEP];
        panics_with("packed for another kernel", || {
            (gemm.max)(&rows, &odd, 0..odd.n_panels(), &mut maxima);
        });
    }
}

/// The tests of the kernels that `$kernels()` gives.
macro_rules! suite {
    ($kernels:path) => {
        use test_support::need;
        use $crate::kernel::suite as must;

        /// The kernels; an error if this machine cannot run them.
        fn here() -> Result<&'static $crate::kernel::Kernels, String> {
            let lack = concat!("this machine lacks the instructions of ", module_path!());
            $kernels().ok_or_else(|| lack.to_owned())
        }

        #[test]
        fn f32_products() {
            let gemm = need!(must::products(need!(here()).f32.as_ref()));
            must::float_rows_are_near_exact(gemm);
            must::float_rows_are_finished(gemm);
            must::float_maxima_are_those_of_the_rows(gemm);
            must::a_range_of_panels_is_its_own(gemm);
            must::operands_that_do_not_fit_are_refused(gemm, 1);
        }

        #[test]
        fn f16_products() {
            let gemm = need!(must::products(need!(here()).f16.as_ref()));
            must::float_rows_are_near_exact(gemm);
            must::float_rows_are_finished(gemm);
            must::float_maxima_are_those_of_the_rows(gemm);
            must::a_range_of_panels_is_its_own(gemm);
            must::operands_that_do_not_fit_are_refused(gemm, 1);
        }

        #[test]
        fn i8_products() {
            let gemm = need!(must::products(need!(here()).i8.as_ref()));
            must::integers_are_exact(gemm);
            must::operands_that_do_not_fit_are_refused(gemm, 4);
        }

        #[test]
        fn vectors() {
            let kernels = need!(here());
            must::gemv_is_near_exact(kernels);
            must::narrowing_is_the_reference(kernels);
            must::fps_is_the_reference(kernels);
        }

        #[test]
        fn prefilter() {
            let kernels = need!(here());
            must::levels_are_the_reference(kernels);
            must::candidates_are_those_of_the_reference(kernels);
            must::dots_are_near_exact(kernels);
        }
    };
}
pub(super) use suite;
