//! The forward pass, divided among a team of threads by rows of cells.
//!
//! Most cells of a sweep seen from above hold nothing, and what a layer makes of nothing is always
//! the same: it is computed once, when the network is loaded.

use std::sync::{Mutex, PoisonError, RwLock};

use edgepuck_kernels::{Format, Kernels, Panels, Rows};

use super::image::{Image, SIDE};
use super::layers::{Layer, Layers};
use super::plan::{HEAD, Of, STEPS, Step};
use crate::engine::team::{Team, Work};

/// The most cells that are multiplied at once.
const BLOCK: usize = 48;

/// A network in any precision.
pub trait Forward: Send + Sync {
    /// Runs the network on `image`, and passes each row of the output: for each cell of 0.4 m the
    /// outputs of its quarters.
    fn run(&self, image: Image, each: &mut dyn FnMut(usize, &[f32]));
}

/// The layers of a network and the results of its steps.
pub struct Network<T: Format> {
    kernels: &'static Kernels,
    layers: Layers<T>,
    image: RwLock<Option<Image>>,
    step: RwLock<usize>,
    /// The result of each step.
    planes: Vec<Plane<T>>,
    threads: Vec<Mutex<Scratch<T>>>,
}

/// The result of a step, by rows of cells.
struct Plane<T: Format> {
    rows: Vec<RwLock<Row<T>>>,
    /// What the step makes of cells that hold nothing, before and after rounding.
    nothing: (Vec<f32>, Vec<T::Activation>),
}

/// The cells of a row: what the next layers take.
struct Row<T: Format> {
    /// Before rounding, if the step's result is part of a sum or of the output; else empty.
    wide: Vec<f32>,
    narrow: Vec<T::Activation>,
    /// Whether all that a cell comes from holds nothing.
    is_empty: Vec<bool>,
}

/// The working memory of a thread.
struct Scratch<T: Format> {
    columns: Vec<usize>,
    gathered: Vec<T::Activation>,
    products: Vec<f32>,
}

impl<T: Format> Network<T> {
    pub fn new(layers: Layers<T>, kernels: &'static Kernels, n_threads: usize) -> Self {
        let mut sides: Vec<usize> = Vec::new();
        let mut planes = Vec::new();
        for ((number, step), &width) in STEPS.iter().enumerate().zip(&layers.widths) {
            let side = match step.of {
                Of::Image => SIDE,
                Of::Conv { from, stride, .. } => sides[from].div_ceil(stride),
                Of::Sum { whole, .. } => sides[whole],
            };
            let row = || Row {
                wide: vec![0.0; if is_wide(number) { side * width } else { 0 }],
                narrow: vec![T::Activation::default(); side * width],
                is_empty: vec![true; side],
            };
            let nothing = (vec![0.0; width], vec![T::Activation::default(); width]);
            planes.push(Plane { rows: (0..side).map(|_| RwLock::new(row())).collect(), nothing });
            sides.push(side);
        }
        let scratch = || {
            Mutex::new(Scratch { columns: Vec::new(), gathered: Vec::new(), products: Vec::new() })
        };
        let mut network = Self {
            kernels,
            layers,
            image: RwLock::new(None),
            step: RwLock::new(0),
            planes,
            threads: (0..n_threads.max(1)).map(|_| scratch()).collect(),
        };
        for step in 0..STEPS.len() {
            network.planes[step].nothing = network.of_nothing(step);
        }
        network
    }

    /// What a step makes of cells that hold nothing.
    fn of_nothing(&self, step: usize) -> (Vec<f32>, Vec<T::Activation>) {
        let mut wide = match (&self.layers.of[step], STEPS[step].of) {
            (Layer::Image { bias, .. }, _) => bias.iter().map(|bias| bias.max(0.0)).collect(),
            (Layer::Conv(panels), Of::Conv { from, size, .. }) => {
                let mut inputs = self.planes[from].nothing.1.repeat(size * size);
                inputs.resize(panels.padded_inputs(), T::Activation::default());
                let mut products = vec![0.0; panels.padded_outputs()];
                self.multiply(panels, &inputs, 1, &mut products);
                products
            }
            (_, Of::Sum { whole, half }) => {
                let [whole, half] = [whole, half].map(|step| &self.planes[step].nothing.0);
                whole.iter().zip(half).map(|(a, b)| a + b).collect()
            }
            _ => unreachable!("invariant: a step's layer is of its kind"),
        };
        wide.truncate(self.layers.widths[step]);
        let mut narrow = vec![T::Activation::default(); wide.len()];
        if step != HEAD {
            T::narrow(self.kernels, &wide, self.layers.ranges[step], &mut narrow);
        }
        (wide, narrow)
    }

    /// Multiplies `n` rows of inputs by the weights.
    fn multiply(
        &self,
        panels: &Panels<T::Weight>,
        rows: &[T::Activation],
        n: usize,
        out: &mut [f32],
    ) {
        let gemm = T::gemm(self.kernels).expect("invariant: kernels are chosen for the format");
        let rows = Rows::new(rows, panels.padded_inputs(), n);
        let used = panels.outputs().div_ceil(panels.nr());
        (gemm.rows)(&rows, panels, 0..used, out, panels.padded_outputs());
    }

    /// Computes a row of the image's layer.
    fn cells(&self, step: usize, number: usize, thread: usize) {
        let image = read(&self.image);
        let (Some(image), Layer::Image { bias, weights }) = (&*image, &self.layers.of[step]) else {
            return;
        };
        let mut scratch = lock(&self.threads[thread]);
        let out = &mut scratch.products;
        let mut row = write(&self.planes[step].rows[number]);
        let Row { narrow, is_empty, .. } = &mut *row;
        for (column, narrow) in narrow.chunks_exact_mut(bias.len()).enumerate() {
            is_empty[column] = image.is_empty(number, column);
            if is_empty[column] {
                narrow.copy_from_slice(&self.planes[step].nothing.1);
                continue;
            }
            out.clear();
            out.extend_from_slice(bias);
            image.channels(number, column, |channel, value| {
                let weights = &weights[channel * bias.len()..][..bias.len()];
                out.iter_mut().zip(weights).for_each(|(out, weight)| *out += value * weight);
            });
            out.iter_mut().for_each(|value| *value = value.max(0.0));
            T::narrow(self.kernels, out, self.layers.ranges[step], narrow);
        }
    }

    /// Computes a row of a convolution.
    fn convolve(
        &self,
        (step, number): (usize, usize),
        (from, size, stride): (usize, usize, usize),
        thread: usize,
    ) {
        let Layer::Conv(panels) = &self.layers.of[step] else { return };
        let (source, width, channels) =
            (&self.planes[from], self.layers.widths[step], self.layers.widths[from]);
        let mut scratch = lock(&self.threads[thread]);
        let Scratch { columns, gathered, products } = &mut *scratch;
        let (reach, side) = (size / 2, source.rows.len());
        // The rows under the kernel; beyond the edge there is none.
        let under: Vec<_> = (0..size)
            .map(|k| {
                (number * stride + k)
                    .checked_sub(reach)
                    .and_then(|row| source.rows.get(row))
                    .map(read)
            })
            .collect();
        let mut row = write(&self.planes[step].rows[number]);
        let Row { wide, narrow, is_empty } = &mut *row;
        // Beyond the edge are zeros, which are not what the layers make of nothing.
        let is_empty_under = |column: usize| {
            let first = (column * stride).checked_sub(reach);
            first.is_some_and(|first| first + size <= side)
                && under.iter().all(|row| {
                    row.as_ref().is_some_and(|row| {
                        row.is_empty[column * stride - reach..][..size].iter().all(|empty| *empty)
                    })
                })
        };
        columns.clear();
        for column in 0..is_empty.len() {
            is_empty[column] = is_empty_under(column);
            if is_empty[column] {
                if let Some(wide) = wide.chunks_exact_mut(width).nth(column) {
                    wide.copy_from_slice(&self.planes[step].nothing.0);
                }
                narrow[column * width..][..width].copy_from_slice(&self.planes[step].nothing.1);
            } else {
                columns.push(column);
            }
        }
        let stride_in = panels.padded_inputs();
        gathered.clear();
        gathered.resize(BLOCK * stride_in, T::Activation::default());
        products.resize(BLOCK * panels.padded_outputs(), 0.0);
        for block in columns.chunks(BLOCK) {
            for (&column, inputs) in block.iter().zip(gathered.chunks_exact_mut(stride_in)) {
                gather(&under, column * stride, channels, &mut inputs[..size * size * channels]);
            }
            self.multiply(panels, gathered, block.len(), products);
            for (&column, products) in
                block.iter().zip(products.chunks_exact(panels.padded_outputs()))
            {
                if let Some(wide) = wide.chunks_exact_mut(width).nth(column) {
                    wide.copy_from_slice(&products[..width]);
                }
                if step != HEAD {
                    let out = &mut narrow[column * width..][..width];
                    T::narrow(self.kernels, &products[..width], self.layers.ranges[step], out);
                }
            }
        }
    }

    /// Computes a row of a sum.
    fn add(&self, step: usize, number: usize, [whole, half]: [usize; 2], thread: usize) {
        let width = self.layers.widths[step];
        let [whole, half] =
            [&self.planes[whole].rows[number], &self.planes[half].rows[number / 2]].map(read);
        let mut row = write(&self.planes[step].rows[number]);
        let mut scratch = lock(&self.threads[thread]);
        let out = &mut scratch.products;
        let Row { narrow, is_empty, .. } = &mut *row;
        for (column, narrow) in narrow.chunks_exact_mut(width).enumerate() {
            is_empty[column] = whole.is_empty[column] && half.is_empty[column / 2];
            if is_empty[column] {
                narrow.copy_from_slice(&self.planes[step].nothing.1);
                continue;
            }
            let a = &whole.wide[column * width..][..width];
            let b = &half.wide[column / 2 * width..][..width];
            out.clear();
            out.extend(a.iter().zip(b).map(|(a, b)| a + b));
            T::narrow(self.kernels, out, self.layers.ranges[step], narrow);
        }
    }
}

/// Copies the cells about `column` side by side; beyond the edge are zeros.
fn gather<T: Format>(
    under: &[Option<std::sync::RwLockReadGuard<'_, Row<T>>>],
    column: usize,
    channels: usize,
    out: &mut [T::Activation],
) {
    let size = under.len();
    for (row, out) in under.iter().zip(out.chunks_exact_mut(size * channels)) {
        let side = row.as_ref().map_or(0, |row| row.is_empty.len());
        // The cells of this row that there are: from `first` to `last` of those under the kernel.
        let first = (size / 2).saturating_sub(column).min(size);
        let last = (side + size / 2).saturating_sub(column).clamp(first, size);
        out[..first * channels].fill(T::Activation::default());
        out[last * channels..].fill(T::Activation::default());
        if let Some(row) = row.as_ref().filter(|_| first < last) {
            let begin = (column + first - size / 2) * channels;
            let cells = &row.narrow[begin..][..(last - first) * channels];
            out[first * channels..last * channels].copy_from_slice(cells);
        }
    }
}

/// Whether the result of a step is part of a sum or the output.
fn is_wide(step: usize) -> bool {
    let is_summand =
        |other: &Step| matches!(other.of, Of::Sum { whole, half } if whole == step || half == step);
    step == HEAD || STEPS.iter().any(is_summand)
}

impl<T: Format> Work for Network<T> {
    fn chunk(&self, thread: usize, row: usize) {
        let step = *read(&self.step);
        match STEPS[step].of {
            Of::Image => self.cells(step, row, thread),
            Of::Conv { from, size, stride } => {
                self.convolve((step, row), (from, size, stride), thread)
            }
            Of::Sum { whole, half } => self.add(step, row, [whole, half], thread),
        }
    }
}

impl<T: Format> Forward for Team<Network<T>> {
    fn run(&self, image: Image, each: &mut dyn FnMut(usize, &[f32])) {
        let network = self.work();
        *write(&network.image) = Some(image);
        for step in 0..STEPS.len() {
            *write(&network.step) = step;
            Self::run(self, network.planes[step].rows.len());
        }
        for (number, row) in network.planes[HEAD].rows.iter().enumerate() {
            each(number, &read(row).wide);
        }
    }
}

/// Only a panic of another thread poisons a lock. It is a defect, which the caller must see.
fn read<V>(lock: &RwLock<V>) -> std::sync::RwLockReadGuard<'_, V> {
    lock.read().unwrap_or_else(|_| panic!("a worker panicked"))
}

fn write<V>(lock: &RwLock<V>) -> std::sync::RwLockWriteGuard<'_, V> {
    lock.write().unwrap_or_else(|_| panic!("a worker panicked"))
}

fn lock<V>(lock: &Mutex<V>) -> std::sync::MutexGuard<'_, V> {
    lock.lock().unwrap_or_else(|_: PoisonError<_>| panic!("a worker panicked"))
}
