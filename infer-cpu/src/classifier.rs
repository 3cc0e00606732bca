//! From a cloud to a class.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use formats::model_card::{ModelCard, Normalization};

use crate::engine::Memory;
use crate::error::Error;
use crate::forward::{self, Forward};
use crate::kernel::{self, KernelName, Kernels};
use crate::normalize;
use crate::precision::Precision;
use crate::prediction::{Prediction, argmax};

/// How a [`Classifier`] computes.
#[derive(Clone, Debug)]
pub struct Options {
    /// What to compute in.
    pub precision: Precision,
    /// The kernels to use; the fastest that this machine runs if `None`.
    pub kernel: Option<KernelName>,
    /// Threads, the caller's among them.
    pub threads: usize,
    /// How clouds are normalised; as in training if `None`.
    pub normalization: Option<Normalization>,
    /// Drop points that are not finite instead of refusing the cloud.
    pub drop_invalid: bool,
    /// Points to make room for at once; larger clouds allocate when they come.
    pub capacity: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: Precision::F32,
            kernel: None,
            threads: 1,
            normalization: None,
            drop_invalid: false,
            capacity: 4096,
        }
    }
}

/// A network ready to classify clouds.
pub struct Classifier {
    path: PathBuf,
    card: ModelCard,
    classes: Vec<Arc<str>>,
    options: Options,
    kernels: &'static Kernels,
    network: Box<dyn Forward>,
    /// fp32, once a cloud overflowed the precision asked for.
    fallback: Option<Box<dyn Forward>>,
    memory: Memory,
    finite: Vec<[f64; 3]>,
    normalized: Vec<[f32; 3]>,
    prediction: Prediction,
}

impl Classifier {
    /// Loads the model file at `path` and packs it as `options` ask.
    ///
    /// # Errors
    /// A file that is no model, or kernels that this machine lacks.
    pub fn load(path: &Path, options: &Options) -> Result<Self, Error> {
        let kernels = choose_kernels(options.precision, options.kernel)?;
        let (card, network) = forward::load(path, options.precision, kernels, options.threads)?;
        let classes = class_names(&card, network.n_classes());
        let prediction = Prediction {
            class: 0,
            label: Arc::clone(&classes[0]),
            logits: Vec::with_capacity(classes.len()),
            n_points: 0,
            n_dropped: 0,
            n_used: 0,
            precision: options.precision,
            n_clipped: 0,
        };
        let memory = network.memory();
        let mut classifier = Self {
            path: path.to_path_buf(),
            card,
            classes,
            options: options.clone(),
            kernels,
            network,
            fallback: None,
            memory,
            finite: Vec::new(),
            normalized: Vec::new(),
            prediction,
        };
        classifier.reserve(options.capacity);
        Ok(classifier)
    }

    /// Makes room for clouds of `n` points, so that none of them allocates.
    pub fn reserve(&mut self, n: usize) {
        self.network.reserve(n);
        self.finite.reserve(n);
        self.normalized.reserve(n);
    }

    /// Class names in the order of the logits.
    #[must_use]
    pub fn classes(&self) -> &[Arc<str>] {
        &self.classes
    }

    /// What the model file says about itself.
    #[must_use]
    pub fn card(&self) -> &ModelCard {
        &self.card
    }

    /// The instruction set in use.
    #[must_use]
    pub fn kernel(&self) -> KernelName {
        self.kernels.name
    }

    /// Classifies a cloud of points in metres, or whatever the unit: only
    /// shape counts.
    ///
    /// # Errors
    /// A cloud without points; one with a coordinate that is not finite, unless
    /// [`Options::drop_invalid`]; a network whose arithmetic overflows.
    pub fn classify(&mut self, points: &[[f32; 3]]) -> Result<&Prediction, Error> {
        self.take(points.iter().map(|point| point.map(f64::from)))?;
        self.predict()
    }

    /// The same for coordinates that f32 does not hold.
    ///
    /// # Errors
    /// As [`Classifier::classify`].
    pub fn classify_f64(&mut self, points: &[[f64; 3]]) -> Result<&Prediction, Error> {
        self.take(points.iter().copied())?;
        self.predict()
    }

    /// Keeps what is finite of `points`.
    fn take(&mut self, points: impl Iterator<Item = [f64; 3]>) -> Result<(), Error> {
        self.finite.clear();
        self.prediction.n_dropped = 0;
        for (index, point) in points.enumerate() {
            if point.iter().all(|x| x.is_finite()) {
                self.finite.push(point);
            } else if self.options.drop_invalid {
                self.prediction.n_dropped += 1;
            } else {
                let [x, y, z] = point;
                return Err(Error::NotFinite { index, x, y, z });
            }
        }
        self.prediction.n_points = self.finite.len();
        match self.finite.len() {
            0 => Err(Error::NoPoints),
            n if u32::try_from(n).is_err() => Err(Error::TooManyPoints(n)),
            _ => Ok(()),
        }
    }

    fn predict(&mut self) -> Result<&Prediction, Error> {
        match self.options.normalization.unwrap_or(self.card.normalization) {
            Normalization::UnitSphere => {
                normalize::to_unit_sphere(&self.finite, &mut self.normalized);
            }
            Normalization::None => {
                self.normalized.clear();
                self.normalized.extend(self.finite.iter().map(|point| point.map(|x| x as f32)));
            }
        }
        self.network.set_points(&self.normalized);
        self.network.classify(&mut self.memory, false);
        let met = self.network.met();
        self.prediction.precision = self.options.precision;
        if met.overflow || !all_finite(&self.memory.values) {
            self.predict_in_f32()?;
        }
        self.prediction.n_used = self.normalized.len();
        self.prediction.n_clipped = met.clipped;
        self.prediction.logits.clone_from(&self.memory.values);
        self.prediction.class = argmax(&self.prediction.logits);
        self.prediction.label = Arc::clone(&self.classes[self.prediction.class]);
        Ok(&self.prediction)
    }

    /// The way out when the precision asked for overflows.
    fn predict_in_f32(&mut self) -> Result<(), Error> {
        if self.options.precision == Precision::F32 {
            return Err(Error::Overflow);
        }
        if self.fallback.is_none() {
            let kernels = choose_kernels(Precision::F32, self.options.kernel)?;
            let loaded = forward::load(&self.path, Precision::F32, kernels, self.options.threads)?;
            self.fallback = Some(loaded.1);
        }
        let Some(network) = &self.fallback else { return Err(Error::Overflow) };
        network.set_points(&self.normalized);
        network.classify(&mut self.memory, false);
        self.prediction.precision = Precision::F32;
        if all_finite(&self.memory.values) { Ok(()) } else { Err(Error::Overflow) }
    }
}

fn all_finite(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_finite())
}

fn class_names(card: &ModelCard, n_classes: usize) -> Vec<Arc<str>> {
    match card.classes.is_empty() {
        true => (0..n_classes).map(|class| format!("class {class}").into()).collect(),
        false => card.classes.iter().map(|name| name.as_str().into()).collect(),
    }
}

/// The kernels `forced`, or the fastest here that have products in `precision`.
fn choose_kernels(
    precision: Precision,
    forced: Option<KernelName>,
) -> Result<&'static Kernels, Error> {
    if let Some(kernel) = forced {
        let kernels = kernel.kernels().ok_or(Error::KernelMissing(kernel))?;
        return match precision.runs_on(kernels) {
            true => Ok(kernels),
            false => Err(Error::KernelPrecision { kernel, precision }),
        };
    }
    let mut able = kernel::available().filter(|kernels| precision.runs_on(kernels));
    able.next().ok_or(Error::KernelMissing(KernelName::Scalar))
}
