//! The network against its convolutions written out in f64, for weights and sweeps drawn at random.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use edgepuck_segment::Label;
use formats::FormatError;
use formats::model_card::ModelCard;
use formats::rng::StreamKey;
use formats::weights::{Tensor, WeightsFile, write_weights};

use super::image::{CHANNELS, Image, SIDE};
use super::plan::{CLASSES, HEAD, OUTPUTS, Of, STEPS};
use super::{BirdsEye, Heights};
use crate::classify::options::Options;
use crate::precision::Precision;

type Tensors = BTreeMap<String, Tensor>;

/// The channels of the five scales.
const WIDTHS: [usize; 5] = [4, 6, 8, 8, 12];

fn drawn(name: &str, n: usize, low: f64, high: f64) -> Vec<f32> {
    let key = StreamKey::new(3, name, 0);
    (0..n).map(|i| (low + (high - low) * key.unit(i as u64)) as f32).collect()
}

/// The outputs of a step.
fn width(step: usize) -> usize {
    match (STEPS[step].name, STEPS[step].of) {
        ("head", _) => OUTPUTS,
        (_, Of::Sum { whole, .. }) => width(whole),
        ("cell", _) => WIDTHS[0],
        ("down1" | "a1" | "up1" | "join1", _) => WIDTHS[1],
        ("down2" | "b1" | "b2" | "up2" | "join2", _) => WIDTHS[2],
        ("down3" | "c1" | "c2" | "up3" | "join3", _) => WIDTHS[3],
        _ => WIDTHS[4],
    }
}

fn tensors() -> Tensors {
    let mut all = Tensors::new();
    for (number, step) in STEPS.iter().enumerate() {
        let (inputs, size) = match step.of {
            Of::Image => (CHANNELS, 1),
            Of::Conv { from, size, .. } => (width(from), size),
            Of::Sum { .. } => continue,
        };
        let (outputs, area) = (width(number), size * size);
        // He et al. 2015, so that activations keep their magnitude.
        let bound = (6.0 / (inputs * area) as f64).sqrt();
        let values = drawn(step.name, outputs * inputs * area, -bound, bound);
        let weight = Tensor { shape: vec![outputs, inputs, size, size], values };
        let values = drawn(&format!("{} bias", step.name), outputs, -0.2, 0.4);
        all.insert(format!("{}.weight", step.name), weight);
        all.insert(format!("{}.bias", step.name), Tensor { shape: vec![outputs], values });
    }
    all
}

fn card(range: f32) -> ModelCard {
    let names = STEPS.iter().filter(|step| step.name != "head").map(|step| step.name.to_owned());
    ModelCard {
        activation_ranges: names.map(|name| (name, range)).collect(),
        classes: CLASSES.map(str::to_owned).to_vec(),
        ..ModelCard::default()
    }
}

fn written(folder: &Path, tensors: &Tensors, card: &ModelCard) -> PathBuf {
    let path = folder.join("bev.safetensors");
    write_weights(&path, tensors, &card.to_metadata()).unwrap();
    path
}

fn loaded(path: &Path, options: &Options) -> Result<BirdsEye, crate::Error> {
    let mut file = WeightsFile::open(path)?;
    let card = ModelCard::read(path)?;
    BirdsEye::new(&mut file, &card, options)
}

/// Points in some cells in the middle, at two edges and in two corners; ground about the middle.
fn sweep() -> (Vec<[f32; 3]>, Vec<Label>) {
    let middles = [[0.0, 0.0], [39.9, 0.0], [3.0, -39.9], [39.95, 39.95], [-39.9, -39.9]];
    let xy = drawn("xy", 600, -2.0, 2.0);
    let z = drawn("z", 300, -1.6, 2.0);
    let object = |i: usize| {
        let [x, y] = middles[i % 5];
        ([x + xy[2 * i], y + xy[2 * i + 1], z[i]], Label::Small)
    };
    let at = drawn("ground", 200, -6.0, 6.0);
    let ground = |i: usize| ([at[2 * i], at[2 * i + 1], -1.8], Label::Ground);
    (0..300).map(object).chain((0..100).map(ground)).unzip()
}

/// The channels of all cells, [row, column, channel].
fn dense(image: &Image) -> Vec<f64> {
    let mut all = vec![0.0; SIDE * SIDE * CHANNELS];
    for (cell, values) in all.chunks_mut(CHANNELS).enumerate() {
        image.channels(cell / SIDE, cell % SIDE, |channel, value| {
            values[channel] = f64::from(value);
        });
    }
    all
}

/// The outputs of the network, [row, column, output], by its definition, and a card with the largest output of
/// each step.
fn expected(image: &Image, tensors: &Tensors) -> (Vec<f64>, ModelCard) {
    let mut results: Vec<(usize, Vec<f64>)> = Vec::new();
    let mut calibrated = card(1.0);
    for (number, step) in STEPS.iter().enumerate() {
        let result = match step.of {
            Of::Image => convolved(&(SIDE, dense(image)), CHANNELS, 1, step.name, tensors),
            Of::Conv { from, stride, .. } => {
                convolved(&results[from], width(from), stride, step.name, tensors)
            }
            Of::Sum { whole, half } => {
                let ((side, whole), (half_side, half)) = (&results[whole], &results[half]);
                let n = width(number);
                let sum = (0..side * side * n).map(|at| {
                    let (row, column, channel) = (at / n / side, at / n % side, at % n);
                    whole[at] + half[(row / 2 * half_side + column / 2) * n + channel]
                });
                (*side, sum.collect())
            }
        };
        results.push(result);
        if number != HEAD {
            results[number].1.iter_mut().for_each(|value| *value = value.max(0.0));
            let largest = results[number].1.iter().fold(0.0f64, |largest, x| largest.max(*x));
            calibrated.activation_ranges.insert(step.name.to_owned(), largest as f32);
        }
    }
    (results.pop().unwrap().1, calibrated)
}

fn convolved(
    (side, from): &(usize, Vec<f64>),
    inputs: usize,
    stride: usize,
    name: &str,
    tensors: &Tensors,
) -> (usize, Vec<f64>) {
    let [weight, bias] = ["weight", "bias"].map(|part| &tensors[&format!("{name}.{part}")]);
    let (outputs, size) = (weight.shape[0], weight.shape[2]);
    let out_side = side.div_ceil(stride);
    let mut out = Vec::with_capacity(out_side * out_side * outputs);
    for at in 0..out_side * out_side * outputs {
        let (row, column, output) =
            (at / outputs / out_side, at / outputs % out_side, at % outputs);
        let mut sum = f64::from(bias.values[output]);
        for (i, j) in (0..size * size).map(|k| (k / size, k % size)) {
            let [y, x] =
                [row * stride + i, column * stride + j].map(|at| at.wrapping_sub(size / 2));
            if y < *side && x < *side {
                for input in 0..inputs {
                    let weight = weight.values[((output * inputs + input) * size + i) * size + j];
                    sum += f64::from(weight) * from[(y * side + x) * inputs + input];
                }
            }
        }
        out.push(sum);
    }
    (out_side, out)
}

fn outputs(network: &BirdsEye, image: Image) -> Vec<f64> {
    let mut all = Vec::new();
    network.network.run(image, &mut |_, row| all.extend(row.iter().map(|&x| f64::from(x))));
    all
}

/// The network that is written out has the same steps: what they join is told here once more, as in
/// `python/training/birdseye`.
#[test]
fn each_step_takes_the_one_before_and_sums_the_last_of_their_scale_on_the_way_down() {
    let mut sums = Vec::new();
    for (number, step) in STEPS.iter().enumerate() {
        match step.of {
            Of::Image => assert_eq!(number, 0),
            Of::Conv { from, .. } => assert_eq!(from, number - 1, "{}", step.name),
            Of::Sum { whole, half } => {
                sums.push([step.name, STEPS[whole].name, STEPS[half].name]);
            }
        }
    }
    assert_eq!(sums, [["sum3", "c2", "up3"], ["sum2", "b2", "up2"], ["sum1", "a1", "up1"]]);
}

/// In f32 the sums of up to 423 products of numbers about 1 are off by less than 1e-4 after 19 layers. int8
/// has 127 steps up to the range of a layer, and its error is a small part of the outputs' spread.
#[test]
fn a_sweep_has_the_outputs_of_the_network_written_out() {
    let folder = tempfile::tempdir().unwrap();
    let (points, labels) = sweep();
    let ground = Heights::of(&points, &labels).unwrap();
    let image = || Image::new(&points, &labels, &ground);
    let (expected, calibrated) = expected(&image(), &tensors());
    let mean = expected.iter().sum::<f64>() / expected.len() as f64;
    let spread = |off: &dyn Fn(usize) -> f64| {
        ((0..expected.len()).map(|i| off(i).powi(2)).sum::<f64>() / expected.len() as f64).sqrt()
    };
    let usual = spread(&|i| expected[i] - mean);
    assert!(usual > 0.1, "{usual}");
    let path = written(folder.path(), &tensors(), &calibrated);
    for threads in [1, 3] {
        for (precision, most) in [(Precision::F32, 1e-4), (Precision::I8, 0.03 * usual)] {
            let options = Options { precision, threads, ..Options::default() };
            let network = loaded(&path, &options).unwrap();
            // The second sweep finds the memory of another one.
            outputs(&network, Image::new(&points[..100], &labels[..100], &ground));
            let found = outputs(&network, image());
            assert_eq!(found.len(), expected.len());
            let off = spread(&|i| expected[i] - found[i]);
            assert!(off < most, "{precision:?}, {threads} threads: {off} of {usual}");
        }
    }
}

#[test]
fn a_file_that_lacks_a_part_or_has_another_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |tensors: &Tensors, card: &ModelCard| {
        let path = written(folder.path(), tensors, card);
        match loaded(&path, &Options::default()).map(|_| ()) {
            Err(crate::Error::Format(error @ FormatError::Malformed { .. })) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    let changed = |change: &dyn Fn(&mut Tensors)| {
        let mut tensors = tensors();
        change(&mut tensors);
        refused(&tensors, &card(1.0))
    };
    let absent = changed(&|all| drop(all.remove("b2.bias")));
    assert!(absent.contains("b2.bias"), "{absent}");
    let shape = changed(&|all| all.get_mut("b2.weight").unwrap().shape = vec![8, 72, 1, 1]);
    assert!(shape.contains("layer `b2`: expected shapes [n, 8, 3, 3] and [n]"), "{shape}");
    let nan = changed(&|all| all.get_mut("up3.bias").unwrap().values[0] = f32::NAN);
    assert!(nan.contains("tensor `up3.bias`: element 0 is NaN"), "{nan}");
    let sum = changed(&|all| {
        let layer = [("weight", vec![7, 12, 1, 1]), ("bias", vec![7])];
        for (part, shape) in layer {
            let values = vec![0.0; shape.iter().product()];
            all.insert(format!("up3.{part}"), Tensor { shape, values });
        }
    });
    assert!(sum.contains("layer `up3`: expected 8 outputs, found 7"), "{sum}");
    let unknown = Tensor { shape: vec![1], values: vec![0.0] };
    let unknown = changed(&|all| drop(all.insert("b3.bias".to_owned(), unknown.clone())));
    assert!(unknown.contains("no layer takes a tensor of this name"), "{unknown}");
    let no_ranges = ModelCard { activation_ranges: BTreeMap::new(), ..card(1.0) };
    let no_range = refused(&tensors(), &no_ranges);
    assert!(no_range.contains("no range in `activation_ranges`"), "{no_range}");
    for range in [0.0, -1.0] {
        let no_range = refused(&tensors(), &card(range));
        assert!(no_range.contains("no range in `activation_ranges`"), "{range}: {no_range}");
    }
    let mut fewer = card(1.0);
    fewer.classes.pop();
    let fewer = refused(&tensors(), &fewer);
    assert!(fewer.contains("metadata `classes`: expected [\"car\", "), "{fewer}");
}
