//! Affine maps in f64 that carry, beside each value, how far a computation in some
//! precision may be from it.
//!
//! Bounds are worst cases (Higham 2002, *Accuracy and Stability of Numerical
//! Algorithms*, section 3.1): n roundings of u each in a row cost at most
//! gamma(n) = n u / (1 - n u) of the sum of magnitudes.

use half::f16;
use infer_cpu::Precision;
use rayon::prelude::*;

/// Half a unit in the last place of f32, relative.
pub const U32: f64 = 1.0 / (1 << 24) as f64;
/// The same of f16.
const U16: f64 = 1.0 / (1 << 11) as f64;
/// Half the least number of f16.
const TINY16: f64 = 1.0 / (1 << 25) as f64;
/// How `infer-cpu` sums products of f16: chunks of 32 products, blocks of 4 chunks,
/// each step rounded to f16 (`kernel/scalar.rs`).
const F16_ROUNDINGS: f64 = 32.0 + 4.0 - 1.0;
const F16_BLOCK: f64 = 128.0;
const LEVELS: f64 = 127.0;

/// The cost of `n` roundings of f32 in a row.
pub fn gamma(n: usize) -> f64 {
    let nu = n as f64 * U32;
    nu / (1.0 - nu)
}

/// Rows of values, each with its bound; `[n, width]`.
#[derive(Clone, Default)]
pub struct Rows {
    pub width: usize,
    pub value: Vec<f64>,
    pub bound: Vec<f64>,
}

/// `y = W x + b`; W may itself be off by `dw`.
#[derive(Clone, Debug)]
pub struct Affine {
    pub inputs: usize,
    pub outputs: usize,
    /// `[outputs, inputs]`.
    pub w: Vec<f64>,
    pub dw: Vec<f64>,
    pub b: Vec<f64>,
    pub relu: bool,
}

/// The kind of a layer, which decides what is rounded.
#[derive(Clone, Copy)]
pub enum Kind {
    /// Takes coordinates: f32 in all precisions.
    First,
    /// Takes features; int8 is calibrated to the largest.
    Point { range: f64 },
    /// Takes a pooled vector.
    Vector,
}

impl Rows {
    pub fn n(&self) -> usize {
        self.value.len() / self.width.max(1)
    }

    /// The maximum of each column. Two maxima differ by at most the largest difference of their
    /// operands.
    pub fn pooled(&self) -> Self {
        let over = |of: &[f64]| {
            let mut most = vec![f64::NEG_INFINITY; self.width];
            for row in of.chunks_exact(self.width) {
                most.iter_mut().zip(row).for_each(|(most, x)| *most = most.max(*x));
            }
            most
        };
        Self { width: self.width, value: over(&self.value), bound: over(&self.bound) }
    }

    /// Sets negative values to 0, which increases no difference.
    pub fn relu(mut self) -> Self {
        self.value.iter_mut().for_each(|x| *x = x.max(0.0));
        self
    }

    /// The rows rounded as inputs of a layer of `kind` in `precision`.
    fn taken(mut self, precision: Precision, kind: Kind) -> Self {
        let Kind::Point { range } = kind else { return self };
        for (x, e) in self.value.iter().zip(&mut self.bound) {
            let size = x.abs() + *e;
            *e += match precision {
                Precision::F32 | Precision::F32Fc16 => 0.0,
                Precision::F16 => U16 * size + TINY16,
                Precision::I8 => 0.5 * range / LEVELS + (size - range).max(0.0) + U32 * size,
            };
        }
        self
    }
}

impl Affine {
    pub fn identity(width: usize) -> Self {
        let mut w = vec![0.0; width * width];
        (0..width).for_each(|i| w[i * width + i] = 1.0);
        let (dw, b) = (vec![0.0; w.len()], vec![0.0; width]);
        Self { inputs: width, outputs: width, w, dw, b, relu: false }
    }

    /// The product of a row with `t` `[k, k]`.
    pub fn transform(t: &Rows, k: usize) -> Self {
        let transposed =
            |of: &[f64]| (0..k * k).map(|at| of[at % k * k + at / k]).collect::<Vec<f64>>();
        let (w, dw) = (transposed(&t.value), transposed(&t.bound));
        Self { inputs: k, outputs: k, w, dw, b: vec![0.0; k], relu: false }
    }

    /// With weights as `precision` stores them for a layer of `kind`: off by as
    /// much as each of them is rounded.
    fn stored(mut self, precision: Precision, kind: Kind) -> Self {
        let is_vector = matches!(kind, Kind::Vector);
        match precision {
            _ if matches!(kind, Kind::First) => {}
            Precision::F32 => {}
            Precision::F32Fc16 if !is_vector => {}
            Precision::F32Fc16 | Precision::F16 => {
                for (w, dw) in self.w.iter().zip(&mut self.dw) {
                    let exact = (w - f64::from(f16::from_f64(*w))).abs();
                    // An inexact weight may round the other way.
                    *dw += if *dw == 0.0 { exact } else { U16 * (w.abs() + *dw) + TINY16 };
                }
            }
            Precision::I8 => {
                let rows = self.w.chunks_exact(self.inputs);
                for (row, dw) in rows.zip(self.dw.chunks_exact_mut(self.inputs)) {
                    let largest = row.iter().zip(&*dw).fold(0.0f64, |m, (w, d)| m.max(w.abs() + d));
                    let half = 0.5 * largest / LEVELS * (1.0 + 4.0 * U32);
                    dw.iter_mut().for_each(|dw| *dw += half);
                }
            }
        }
        self
    }

    /// `rows` through this layer of `kind`, computed in `precision`.
    pub fn through(self, rows: Rows, precision: Precision, kind: Kind) -> Rows {
        let layer = &self.stored(precision, kind);
        let rows = rows.taken(precision, kind);
        let (part, least) = layer.roundings(precision, kind);
        let value = rows.value.par_chunks_exact(layer.inputs);
        let pairs = value.zip(rows.bound.par_chunks_exact(layer.inputs));
        let output = |(x, e)| (0..layer.outputs).map(move |o| layer.output(o, x, e, part, least));
        let (value, bound) = pairs.flat_map_iter(output).unzip();
        let out = Rows { width: layer.outputs, value, bound };
        if layer.relu { out.relu() } else { out }
    }

    fn output(&self, output: usize, x: &[f64], e: &[f64], part: f64, least: f64) -> (f64, f64) {
        let at = output * self.inputs..(output + 1) * self.inputs;
        let (w, dw) = (&self.w[at.clone()], &self.dw[at]);
        let (mut sum, mut off) = (self.b[output], 0.0);
        let mut magnitude = self.b[output].abs();
        for (((w, dw), x), e) in w.iter().zip(dw).zip(x).zip(e) {
            sum += w * x;
            let size = x.abs() + e;
            off += w.abs() * e + dw * size;
            magnitude += (w.abs() + dw) * size;
        }
        (sum, off + part * magnitude + least)
    }

    /// Bounds of the rounding error of a sum of products: relative to the sum of magnitudes, and
    /// absolute where products underflow.
    fn roundings(&self, precision: Precision, kind: Kind) -> (f64, f64) {
        let k = self.inputs as f64;
        match (precision, kind) {
            (Precision::F16, Kind::Point { .. }) => {
                let blocks = (k / F16_BLOCK).ceil();
                (F16_ROUNDINGS * U16 * 1.02 + gamma(blocks as usize + 3), 2.0 * k * TINY16)
            }
            // Sums of whole numbers are exact; scale, their product, bias.
            (Precision::I8, Kind::Point { .. }) => (gamma(6), 0.0),
            _ => (gamma(self.inputs + 3), 0.0),
        }
    }

    /// This map after a turn by `t` `[k, k]`, a row x coming as x T: weights T W.
    pub fn after(&self, t: &Rows, k: usize) -> Self {
        let mut folded = self.clone();
        for output in 0..self.outputs {
            for i in 0..k {
                let (mut sum, mut off) = (0.0, 0.0);
                for j in 0..k {
                    let (w, dw) =
                        (self.w[output * self.inputs + j], self.dw[output * self.inputs + j]);
                    let (t, e) = (t.value[i * k + j], t.bound[i * k + j]);
                    sum += t * w;
                    off +=
                        (t.abs() + e) * dw + e * w.abs() + gamma(k + 2) * (t.abs() + e) * w.abs();
                }
                folded.w[output * self.inputs + i] = sum;
                folded.dw[output * self.inputs + i] = off;
            }
        }
        folded
    }
}
