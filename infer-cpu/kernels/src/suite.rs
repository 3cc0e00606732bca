//! The tests of every kernel: results must equal exact arithmetic within a bound that follows from
//! the number of inputs and the format, for sizes around every tile and for extreme values.
//!
//! [`suite`] generates the tests for one file of kernels; `declare_kernels` calls it. A machine
//! without the instructions skips them.

use std::fmt::Debug;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use formats::rng::StreamKey;

pub use crate::format::{F32, I8};
use crate::format::{Format, Weight};
use crate::table::{Candidate, Gemm, Gemv, Kernels, Soa, Sum};
use crate::{
    Dense, EdgeConv, I8_LARGEST, LANES, NeighborPool, Neighborhood, Panels, PoolStep, Rows, TILE,
    WIDTH_STEP,
};

/// Numbers of rows: none, and around every tile height in use (4, 6, 8, 12).
const ROWS: [usize; 12] = [0, 1, 3, 5, 6, 7, 8, 9, 10, 12, 13, 29];
/// Numbers of inputs: around every unrolling in use (4, 8, 16, 32).
const INPUTS: [usize; 13] = [1, 2, 3, 4, 5, 8, 15, 16, 17, 31, 33, 64, 130];
const OUTPUTS: [usize; 4] = [1, 31, 64, 65];

/// The kind of numbers in a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Uniform in -1..1, or over all integers.
    Ordinary,
    /// Large terms that cancel to small sums.
    Cancelling,
    /// The largest integers.
    Largest,
    /// Denormal weights.
    Denormal,
    /// NaN and infinities among them.
    NotFinite,
}

impl Values {
    const FLOATS: &[Self] = &[Self::Ordinary, Self::Cancelling, Self::Denormal, Self::NotFinite];

    /// The kind of activations for weights of this kind: beside denormal weights they are about 1,
    /// so that products do not vanish.
    fn of_activations(self) -> Self {
        if self == Self::Denormal { Self::Ordinary } else { self }
    }
}

/// A generator of test numbers.
pub struct Draw {
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

    fn float(&mut self, values: Values, at: usize) -> f32 {
        let x = self.signed();
        match values {
            Values::Ordinary | Values::Largest => x,
            Values::Cancelling if at.is_multiple_of(2) => 30.0 + x * 0.01,
            Values::Cancelling => -30.0 + x * 0.01,
            Values::Denormal => x * f32::MIN_POSITIVE,
            Values::NotFinite => match self.below(40) {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => f32::NEG_INFINITY,
                _ => x,
            },
        }
    }

    /// An integer from 0 to 127.
    fn level(&mut self, values: Values) -> u8 {
        match values {
            Values::Largest => I8_LARGEST,
            _ => self.below(u64::from(I8_LARGEST) + 1) as u8,
        }
    }
}

/// A number type of a problem.
pub trait Number: Copy + Default + Into<f64> {
    /// Draws number `at` of a dot product.
    fn draw(draw: &mut Draw, values: Values, at: usize) -> Self;
}

impl Number for f32 {
    fn draw(draw: &mut Draw, values: Values, at: usize) -> f32 {
        draw.float(values, at)
    }
}

impl Number for u8 {
    fn draw(draw: &mut Draw, values: Values, _: usize) -> u8 {
        draw.level(values)
    }
}

impl Number for i8 {
    fn draw(draw: &mut Draw, values: Values, at: usize) -> i8 {
        let level = draw.level(values) as i8;
        if at.is_multiple_of(3) { -level } else { level }
    }
}

/// A format of products, and the bound of their rounding errors.
pub trait Bounded: Format<Activation: Number, Weight: Number, Sum: Debug> {
    /// The kinds of numbers in its problems.
    const VALUES: &[Values];
    /// The error bound of a dot product of `k` terms whose magnitudes sum to `sum`.
    fn bound(k: usize, sum: f64) -> f64;
}

/// Unit roundoff of f32.
const U32: f64 = 1.0 / (1u64 << 24) as f64;

impl Bounded for F32 {
    const VALUES: &[Values] = Values::FLOATS;

    /// Any order of k steps, fused or not, a scale and a bias: (k + 2) u of the sum of magnitudes
    /// to first order (Higham 2002, §3.1), one more for the second order; half a denormal a step,
    /// once for the product and once for the sum, where numbers are that small.
    fn bound(k: usize, sum: f64) -> f64 {
        (k + 3) as f64 * (U32 * sum + 2f64.powi(-149))
    }
}

impl Bounded for I8 {
    const VALUES: &[Values] = &[Values::Ordinary, Values::Largest];

    /// Integers are exact, and as f32 as well, since sums stay below 2^24.
    fn bound(_: usize, _: f64) -> f64 {
        0.0
    }
}

fn reference() -> &'static Kernels {
    crate::scalar::kernels().unwrap()
}

/// A dot product and the sum of its terms' magnitudes.
pub fn dot(terms: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    terms.fold((0.0, 0.0), |(dot, sum), (a, w)| (dot + a * w, sum + (a * w).abs()))
}

/// A matrix product with its exact results.
struct Problem<T: Format> {
    activations: Vec<T::Activation>,
    n: usize,
    stride: usize,
    weights: Panels<T::Weight>,
    /// Row by row: dot product, sum of magnitudes.
    exact: Vec<(f64, f64)>,
}

impl<T: Bounded> Problem<T> {
    fn new(
        gemm: &Products<T>,
        (n, inputs, outputs): (usize, usize, usize),
        values: Values,
    ) -> Self {
        let mut draw = Draw::new(&format!("{n} {inputs} {outputs} {values:?}"));
        let mut weights = Panels::zeros(inputs, outputs, (gemm.nr, gemm.k_step, T::GROUP));
        let plain: Vec<T::Weight> =
            (0..inputs * outputs).map(|i| Number::draw(&mut draw, values, i / outputs)).collect();
        weights.fill(|input, output| plain[input * outputs + output]);
        // The stride exceeds the padded inputs of the panels.
        let stride = weights.padded_inputs() + 4;
        let mut activations = vec![T::Activation::default(); n * stride];
        for row in activations.chunks_exact_mut(stride) {
            row[..inputs].fill_with(|| Number::draw(&mut draw, values.of_activations(), 0));
        }
        let exact = (0..n * outputs)
            .map(|i| {
                let row = &activations[i / outputs * stride..][..inputs];
                let column = plain[i % outputs..].iter().step_by(outputs);
                dot(row.iter().zip(column).map(|(&a, &w)| (a.into(), w.into())))
            })
            .collect();
        Self { activations, n, stride, weights, exact }
    }

    fn rows(&self) -> Rows<'_, T::Activation> {
        Rows::new(&self.activations, self.stride, self.n)
    }

    fn width(&self) -> usize {
        self.weights.padded_outputs()
    }

    fn panels(&self) -> Range<usize> {
        0..self.weights.n_panels()
    }

    fn products(&self, gemm: &Products<T>) -> Vec<f32> {
        let mut out = vec![7.0; self.n * self.width()];
        (gemm.rows)(&self.rows(), &self.weights, self.panels(), &mut out, self.width());
        out
    }

    fn maxima(&self, gemm: &Products<T>, panels: Range<usize>) -> Vec<T::Sum> {
        let mut maxima = vec![T::LOWEST; self.weights.channels(&panels).len()];
        (gemm.max)(&self.rows(), &self.weights, panels, &mut maxima);
        maxima
    }
}

type Products<T> = Gemm<<T as Format>::Activation, <T as Format>::Weight, <T as Format>::Sum>;

fn assert_near(found: f32, exact: f64, bound: f64, place: impl Debug) {
    if exact.is_finite() {
        assert!((f64::from(found) - exact).abs() <= bound, "{place:?}: {found} for {exact}");
    } else {
        let same =
            found.is_nan() == exact.is_nan() && (exact.is_nan() || f64::from(found) == exact);
        assert!(same, "{place:?}: {found} for {exact}");
    }
}

pub fn products_are_sound<T: Bounded>(kernels: &Kernels) -> Result<(), String> {
    let gemm = T::gemm(kernels)
        .ok_or_else(|| "this set of kernels leaves these products to another".to_owned())?;
    for &values in T::VALUES {
        for n in ROWS {
            for inputs in INPUTS {
                for outputs in OUTPUTS {
                    let size = (n, inputs, outputs);
                    let problem = Problem::<T>::new(gemm, size, values);
                    rows_are_near_exact(gemm, &problem, (size, values));
                    maxima_are_those_of_the_rows(gemm, problem, (size, values));
                }
            }
        }
    }
    rows_are_finished::<T>(gemm);
    a_range_of_panels_is_its_own::<T>(gemm);
    operands_that_do_not_fit_are_refused::<T>(gemm);
    Ok(())
}

type Case = ((usize, usize, usize), Values);

fn rows_are_near_exact<T: Bounded>(gemm: &Products<T>, problem: &Problem<T>, case: Case) {
    let ((_, inputs, outputs), _) = case;
    let out = problem.products(gemm);
    for (i, &(dot, sum)) in problem.exact.iter().enumerate() {
        let (row, output) = (i / outputs, i % outputs);
        let found = out[row * problem.width() + output];
        assert_near(found, dot, T::bound(inputs, sum), (case, row, output));
    }
}

/// Checks that maxima and winners equal those of the products, to the bit, with the first of equal
/// rows, for every position in a tile.
fn maxima_are_those_of_the_rows<T: Bounded>(
    gemm: &Products<T>,
    mut problem: Problem<T>,
    case: Case,
) {
    // Some rows twice: ties.
    for row in (2..problem.n).step_by(3) {
        problem.activations.copy_within(0..problem.stride, row * problem.stride);
    }
    let (width, panels) = (problem.width(), problem.panels());
    let out = problem.products(gemm);
    let alone = problem.maxima(gemm, panels.clone());
    let (mut maxima, mut winners) = (vec![T::LOWEST; width], vec![u32::MAX; width]);
    (gemm.argmax)(&problem.rows(), &problem.weights, panels, 100, &mut maxima, &mut winners);
    let ((_, _, outputs), _) = case;
    for output in 0..outputs {
        let column = (0..problem.n).map(|row| out[row * width + output]);
        let none = (T::LOWEST.to_f32(), u32::MAX);
        let best =
            column.zip(100u32..).fold(none, |best, next| if next.0 > best.0 { next } else { best });
        assert_eq!((maxima[output].to_f32(), winners[output]), best, "{case:?} {output}");
        assert_eq!(alone[output].to_f32(), best.0, "{case:?} {output}");
    }
}

/// Checks that scale, bias and ReLU are applied in this order to every channel.
fn rows_are_finished<T: Bounded>(gemm: &Products<T>) {
    let (inputs, outputs) = (17, 65);
    let mut problem = Problem::<T>::new(gemm, (13, inputs, outputs), Values::Ordinary);
    for output in 0..problem.width() {
        problem.weights.scales_mut()[output] = 0.5 + output as f32;
        problem.weights.biases_mut()[output] = 3.0 - output as f32;
    }
    for relu in [false, true] {
        problem.weights.relu = relu;
        let out = problem.products(gemm);
        for (i, &(dot, sum)) in problem.exact.iter().enumerate() {
            let (row, output) = (i / outputs, i % outputs);
            let (scale, bias) = (0.5 + output as f64, 3.0 - output as f64);
            let exact = dot * scale + bias;
            let exact = if relu { exact.max(0.0) } else { exact };
            let bound = T::bound(inputs, sum) * scale + F32::bound(3, bias.abs() + sum * scale);
            assert_near(out[row * problem.width() + output], exact, bound, (row, output, relu));
        }
    }
}

/// Checks that a range of panels writes only its own channels.
fn a_range_of_panels_is_its_own<T: Bounded>(gemm: &Products<T>) {
    let problem = Problem::<T>::new(gemm, (13, 17, 65), Values::Ordinary);
    let each = problem.panels().map(|panel| panel..panel + 1);
    let mut parts = vec![7.0; 13 * problem.width()];
    for panel in each.clone().rev() {
        (gemm.rows)(&problem.rows(), &problem.weights, panel, &mut parts, problem.width());
    }
    assert_eq!(problem.products(gemm), parts);
    let maxima = problem.maxima(gemm, problem.panels());
    for panel in each {
        let channels = problem.weights.channels(&panel);
        assert_eq!(problem.maxima(gemm, panel)[..], maxima[channels]);
    }
}

/// Checks that products with columns are exact within the bound of f32, and that columns of zero
/// inputs, which hold `unread`, are not read.
pub fn gemv_is_near_exact<W: Weight + From<i8>>(gemv: Gemv<W>, unread: W) {
    for inputs in [0, 1, 2, 3, 7, 64, 257] {
        for (outputs, scale) in [(1, 1.0), (9, 0.25), (63, 1.0), (64, 0.25), (65, 1.0), (200, 0.25)]
        {
            let mut draw = Draw::new(&format!("gemv {inputs} {outputs}"));
            let plain: Vec<i8> =
                (0..inputs * outputs).map(|_| (draw.signed() * 127.0) as i8).collect();
            let nonzero: Vec<(u32, f32)> = (0..inputs as u32)
                .filter(|j| j % 3 != 1)
                .map(|j| (j, draw.signed() * 10.0))
                .collect();
            let mut columns = Panels::<W>::columns(inputs, outputs);
            columns.fill(|j, o| if j % 3 == 1 { unread } else { plain[j * outputs + o].into() });
            for (o, bias) in columns.biases_mut().iter_mut().enumerate() {
                *bias = o as f32;
            }
            if scale != 1.0 {
                columns.scales_mut().fill(scale);
            }
            let mut found = vec![7.0; columns.padded_outputs()];
            gemv(&nonzero, &columns, 0..columns.n_panels(), &mut found);
            for o in 0..outputs {
                let weight = |j: u32| f64::from(plain[j as usize * outputs + o]);
                let (dot, sum) = dot(nonzero.iter().map(|&(j, v)| (f64::from(v), weight(j))));
                let bound = F32::bound(inputs, sum + o as f64);
                let exact = dot * f64::from(scale) + o as f64;
                assert_near(found[o], exact, bound, (inputs, outputs, o));
            }
        }
    }
}

pub fn narrowing_is_the_reference(kernels: &Kernels) {
    let reference = reference();
    let mut draw = Draw::new("narrow");
    for n in [0, 1, 7, 8, 15, 16, 17, 64, 100] {
        let mut values: Vec<f32> = (0..n).map(|_| draw.signed() * 100.0).collect();
        let extremes = [70000.0, -70000.0, 1e-8, -0.0, 0.5, 1.5, 126.6, 127.6];
        for (value, extreme) in values.iter_mut().zip(extremes) {
            *value = extreme;
        }
        let (mut found, mut expected) = (vec![9u8; n], vec![0u8; n]);
        for per_unit in [1.0, 0.37] {
            let clipped = (kernels.narrow_i8)(&values, per_unit, &mut found);
            assert_eq!(clipped, (reference.narrow_i8)(&values, per_unit, &mut expected));
            assert_eq!(found, expected, "{n}");
        }
    }
}

/// Checks that levels equal the reference, and that sums of squares are near it: `n` steps each,
/// fused or not (Higham 2002, §3.1).
pub fn levels_are_the_reference(kernels: &Kernels) {
    let reference = reference();
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

/// Checks that peaks equal the reference, with the first of equal rows, and that values above a
/// floor are found in order, or `None` is returned if there is no room.
pub fn candidates_are_those_of_the_reference(kernels: &Kernels) {
    let reference = reference();
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

pub fn dots_are_near_exact(kernels: &Kernels) {
    let mut draw = Draw::new("dots");
    for &values in F32::VALUES {
        for width in [WIDTH_STEP, 3 * WIDTH_STEP] {
            let (n, channels) = (5, 7);
            let mut number = |values, at| f32::draw(&mut draw, values, at);
            let data: Vec<f32> =
                (0..n * width).map(|_| number(values.of_activations(), 0)).collect();
            let weights: Vec<f32> = (0..channels * width).map(|i| number(values, i)).collect();
            let all = (0..n * channels).rev();
            let candidates: Vec<Candidate> = all
                .map(|i| Candidate { row: (i / channels) as u16, channel: (i % channels) as u16 })
                .collect();
            let mut out = vec![7.0; candidates.len()];
            let rows = Rows::new(&data, width, n);
            (kernels.prefilter.dots)(&rows, &weights, &candidates, &mut out);
            for (candidate, out) in candidates.iter().zip(out) {
                let row = data[usize::from(candidate.row) * width..][..width].iter();
                let weights = &weights[usize::from(candidate.channel) * width..][..width];
                let (dot, sum) = dot(row.zip(weights).map(|(&a, &w)| (a.into(), w.into())));
                assert_near(out, dot, F32::bound(width, sum), (values, width, candidate));
            }
        }
    }
}

/// Checks that farthest point sampling picks the same points as the reference, ties included, and
/// computes the same distances to the bit.
pub fn fps_is_the_reference(kernels: &Kernels) {
    let reference = reference();
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

pub fn edge_features_are_near_the_reference(kernels: &Kernels) {
    let mut draw = Draw::new("edges");
    let mut dense = |outputs: usize| Dense {
        name: String::new(),
        inputs: 3,
        outputs,
        weight: (0..3 * outputs).map(|_| draw.signed()).collect(),
        bias: (0..outputs).map(|_| draw.signed()).collect(),
        relu: true,
    };
    let edges = EdgeConv::new(&[(0.3, dense(40)), (0.6, dense(64))]);
    let mut cloud = Neighborhood::default();
    let points: Vec<[f32; 3]> = (0..150).map(|_| [(); 3].map(|()| draw.signed())).collect();
    cloud.set(&points);
    let stride = 3 + 104;
    let mut rows = vec![0.0; 7 * stride];
    for (row, point) in rows.chunks_exact_mut(stride).zip(&points) {
        row[..3].copy_from_slice(point);
    }
    let features = |kernels: &Kernels| {
        let mut rows = rows.clone();
        (kernels.edge_features)(&edges, (&mut rows, stride), &cloud, &mut edges.scratch(7));
        rows
    };
    let expected = features(reference());
    assert!(expected.iter().filter(|&&feature| feature > 0.0).count() > 100);
    // The error of each is at most 150 u: the tests of `edge_conv` derive it for larger weights
    // over the radius (5 there, 3.4 here).
    let bound = 2.0 * 150.0 * f32::EPSILON / 2.0;
    let near = |(found, expected): (&f32, &f32)| (found - expected).abs() <= bound;
    assert!(features(kernels).iter().zip(&expected).all(near));
}

pub fn neighbor_pooling_is_near_the_definition(kernels: &Kernels) {
    let mut draw = Draw::new("neighbor pooling");
    let (n, channels, stride, radius) = (150, 40, 64, 0.5f32);
    let mut signed = |n: usize| (0..n).map(|_| draw.signed()).collect::<Vec<f32>>();
    let (name, weight, bias) = (String::new(), signed(4 * channels), signed(channels));
    let dense = Dense { name, inputs: 4, outputs: channels, weight, bias, relu: true };
    let features = signed(n * stride);
    let mut points: Vec<[f32; 3]> = signed(3 * n).as_chunks().0.to_vec();
    // The last tile is beyond the radius of the centres.
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (cloud, pool) = (Neighborhood::of(&points), NeighborPool::new(radius, &dense));
    let centres = &points[60..67];
    let mut maxima = vec![[f32::NEG_INFINITY; LANES]; centres.len() * pool.n_lanes()];
    for (tile, first) in cloud.tiles().zip((0..).step_by(TILE)) {
        let mut products = vec![[[0.0; LANES]; TILE]; pool.n_lanes()];
        let features = (&features[first * stride..], stride);
        let (points, products) = (0..TILE.min(n - first), &mut products[..]);
        (kernels.pool_neighbors)(&pool, PoolStep::Lift { features, tile, points, products });
        let maxima = &mut maxima[..];
        (kernels.pool_neighbors)(&pool, PoolStep::Raise { tile, products, centres, maxima });
    }
    let (mut out, maxima) = (vec![f32::NAN; centres.len() * stride], &maxima[..]);
    let finish = PoolStep::Finish { centres, maxima, out: (&mut out, stride) };
    (kernels.pool_neighbors)(&pool, finish);
    for (p, out) in centres.iter().zip(out.chunks_exact(stride)) {
        let near = |q: &&[f32; 3]| {
            (0..3).map(|k| (q[k] - p[k]) * (q[k] - p[k])).sum::<f32>() <= radius * radius
        };
        for c in 0..channels {
            let at = |k: usize| f64::from(dense.at(k, c));
            let feature = |(q, u): (&[f32; 3], &[f32])| {
                let offset = |k: usize| f64::from(q[k] - p[k]) / f64::from(radius);
                let along = (0..3).map(|k| at(k + 1) * offset(k)).sum::<f64>();
                at(0) * f64::from(u[c]) + along + f64::from(dense.bias[c])
            };
            let rows = points.iter().zip(features.chunks_exact(stride));
            let expected = rows.filter(|(q, _)| near(q)).map(feature).fold(0.0, f64::max);
            // In units u = EPSILON / 2: weights over the radius are at most 2 and off by 2u,
            // products of three at most 6 and off by 30u, with the feature's at most 7 and off by
            // 38u; the difference is at most 13, the sum with the bias 14, each rounded once.
            let bound = (38.0 + 30.0 + 13.0 + 14.0) * f64::from(f32::EPSILON) / 2.0;
            assert!((f64::from(out[c]) - expected).abs() <= bound, "{}, {expected}", out[c]);
        }
        assert!(out[channels..].iter().all(|padding| *padding == 0.0));
    }
}

pub fn panics_with<T>(words: &str, work: impl FnOnce() -> T) {
    // A panic ends the process: WebAssembly.
    if cfg!(panic = "abort") {
        return;
    }
    let panic = catch_unwind(AssertUnwindSafe(|| drop(work()))).expect_err("it goes through");
    let message = panic.downcast_ref::<String>().map(String::as_str);
    let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or_default();
    assert!(message.contains(words), "expected a message with `{words}`, found `{message}`");
}

/// Checks that kernels reject operands whose ends they would exceed.
fn operands_that_do_not_fit_are_refused<T: Bounded>(gemm: &Products<T>) {
    let (group, k_step) = (T::GROUP, gemm.k_step);
    let panels = Panels::zeros(2 * k_step, WIDTH_STEP, (gemm.nr, k_step, group));
    let all = 0..panels.n_panels();
    let k = panels.padded_inputs();
    let data = vec![T::Activation::default(); 3 * k];
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
    // Inputs that are not whole steps of the kernel's loop.
    if k_step > group {
        let odd = Panels::zeros(2 * k_step - group, WIDTH_STEP, (gemm.nr, group, group));
        let width = odd.padded_inputs();
        let rows = Rows::new(&data[..width], width, 1);
        let mut maxima = vec![T::LOWEST; WIDTH_STEP];
        panics_with("packed for another kernel", || {
            (gemm.max)(&rows, &odd, 0..odd.n_panels(), &mut maxima);
        });
    }
}

/// Generates the tests of the kernels that `$kernels()` returns.
macro_rules! suite {
    ($kernels:path) => {
        use test_support::need;
        use $crate::suite as must;

        /// The kernels; an error if this machine cannot run them.
        fn here() -> Result<&'static $crate::Kernels, String> {
            if test_support::IS_EMULATED && module_path!().contains("::scalar::") {
                return Err("x86-64 tests the scalar kernels".to_owned());
            }
            let lack = concat!("this machine lacks the instructions of ", module_path!());
            $kernels().ok_or_else(|| lack.to_owned())
        }

        #[test]
        fn f32_products() {
            need!(must::products_are_sound::<must::F32>(need!(here())));
        }

        #[test]
        fn i8_products() {
            need!(must::products_are_sound::<must::I8>(need!(here())));
        }

        #[test]
        fn vectors() {
            let kernels = need!(here());
            must::gemv_is_near_exact(kernels.gemv_f32, f32::NAN);
            must::gemv_is_near_exact(kernels.gemv_i8, i8::MAX);
            must::narrowing_is_the_reference(kernels);
            must::fps_is_the_reference(kernels);
            must::edge_features_are_near_the_reference(kernels);
            must::neighbor_pooling_is_near_the_definition(kernels);
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
