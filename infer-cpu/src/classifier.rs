//! From a cloud to a class.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use formats::model_card::{ModelCard, Normalization};

use crate::engine::Memory;
use crate::error::Error;
use crate::forward::{self, Forward, Loaded, Setup};
use crate::kernel::{self, KernelName, Kernels};
use crate::normalize;
use crate::options::{MOST_POINTS, MOST_THREADS, Options};
use crate::precision::Precision;
use crate::prediction::{Prediction, argmax};
use crate::sampler::{SamplerKind, SamplerSpec};
use crate::selection::{Selection, front_pass};
use crate::votes::Votes;

/// A network ready to classify clouds.
///
/// Nothing is allocated once it is loaded, but for clouds of more points than
/// [`Options::capacity`] and for the first that overflows a short precision.
///
/// ```
/// use std::path::Path;
///
/// use infer_cpu::{Classifier, Options};
///
/// let weights = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/weights");
/// let model = Path::new(weights).join("untrained-test.safetensors");
/// let mut classifier = Classifier::load(&model, &Options::default())?;
/// let prediction = classifier.classify(&[[0.0, 0.0, 0.1], [0.3, 0.0, 0.1], [0.3, 0.2, 0.0]])?;
/// assert_eq!(prediction.n_used, 3);
/// println!("{} ({:.1} %)", prediction.label, 100.0 * prediction.confidence());
/// # Ok::<(), infer_cpu::Error>(())
/// ```
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
    selection: Selection,
    votes: Votes,
    finite: Vec<[f64; 3]>,
    normalized: Vec<[f32; 3]>,
    prediction: Prediction,
}

impl Classifier {
    /// Loads the model file at `path` and packs it as `options` ask.
    ///
    /// # Errors
    /// A file that is no model, options that it or this machine cannot meet.
    pub fn load(path: &Path, options: &Options) -> Result<Self, Error> {
        if options.threads > MOST_THREADS {
            return Err(Error::TooManyThreads(options.threads));
        }
        let setup = setup(options, options.precision)?;
        let loaded = forward::load(path, &setup)?;
        let spec = match &options.sampler {
            Some(spec) => spec.clone(),
            None => SamplerSpec::as_trained(path, &loaded.card)?,
        };
        let is_cpl = spec.kind == SamplerKind::Cpl;
        let front = is_cpl.then(|| front_pass(spec.front, &loaded.parts)).transpose()?;
        let selection = Selection::new(&spec, front)?;
        let Loaded { card, network, .. } = loaded;
        let classes = class_names(&card, network.n_classes());
        let prediction = Prediction::empty(&classes, options.precision);
        let mut classifier = Self {
            path: path.to_path_buf(),
            card,
            votes: Votes::new(options, &spec, classes.len())?,
            classes,
            options: options.clone(),
            kernels: setup.kernels,
            memory: network.memory(),
            network,
            fallback: None,
            selection,
            finite: Vec::new(),
            normalized: Vec::new(),
            prediction,
        };
        classifier.reserve(options.capacity)?;
        Ok(classifier)
    }

    /// Makes room for clouds of `n` points, so that none of them allocates.
    ///
    /// # Errors
    /// More points than can be counted.
    pub fn reserve(&mut self, n: usize) -> Result<(), Error> {
        if n > MOST_POINTS {
            return Err(Error::TooMuchRoom(n));
        }
        self.network.reserve(n);
        self.finite.reserve(n);
        self.normalized.reserve(n);
        self.votes.reserve(n);
        self.selection.reserve(n, self.kernels, &*self.network, &mut self.memory)
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

    /// The sampler in use.
    #[must_use]
    pub fn sampler(&self) -> &SamplerSpec {
        self.selection.spec()
    }

    /// Classifies a cloud of points, `[n, 3]`, in metres or whatever the unit:
    /// only shape counts where clouds are normalised.
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

    /// The points that the sampler keeps of a cloud, as indices into it:
    /// repetitions included, where the sampler makes them. The cloud is
    /// normalised for the choice, and must be finite.
    ///
    /// # Errors
    /// A cloud without points, or with a coordinate that is not finite.
    pub fn sample(&mut self, points: &[[f64; 3]]) -> Result<&[u32], Error> {
        if let Some(index) = points.iter().position(|point| !point.iter().all(|x| x.is_finite())) {
            let [x, y, z] = points[index];
            return Err(Error::NotFinite { index, x, y, z });
        }
        self.take(points.iter().copied())?;
        self.normalize();
        let Self { selection, normalized, kernels, network, memory, .. } = self;
        selection.select(normalized, kernels, &**network, memory)
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

    fn normalize(&mut self) {
        match self.options.normalization.unwrap_or(self.card.normalization) {
            Normalization::UnitSphere => {
                normalize::to_unit_sphere(&self.finite, &mut self.normalized);
            }
            Normalization::None => normalize::not_at_all(&self.finite, &mut self.normalized),
        }
    }

    fn predict(&mut self) -> Result<&Prediction, Error> {
        self.normalize();
        self.network.reset();
        self.prediction.precision = self.options.precision;
        if self.votes.n() <= 1 {
            self.forward_whole()?;
            self.prediction.logits.clone_from(&self.memory.values);
        } else {
            self.vote()?;
        }
        self.prediction.n_used = self.selection.points().len();
        self.prediction.n_clipped = self.network.met().clipped;
        self.prediction.class = argmax(&self.prediction.logits);
        self.prediction.label = Arc::clone(&self.classes[self.prediction.class]);
        Ok(&self.prediction)
    }

    /// Takes the normalised cloud through sampler and network; logits are left
    /// in memory.
    fn forward_whole(&mut self) -> Result<(), Error> {
        let Self { selection, normalized, kernels, network, memory, .. } = self;
        selection.select(normalized, kernels, &**network, memory)?;
        network.set_points(selection.points());
        network.set_surroundings(normalized);
        network.classify(memory, selection.pooled_stn());
        if network.met().overflow || !all_finite(&memory.values) {
            self.forward_in_f32()?;
        }
        Ok(())
    }

    /// The way out when the precision asked for overflows.
    fn forward_in_f32(&mut self) -> Result<(), Error> {
        if self.options.precision == Precision::F32 {
            return Err(Error::Overflow);
        }
        if self.fallback.is_none() {
            let setup = setup(&self.options, Precision::F32)?;
            self.fallback = Some(forward::load(&self.path, &setup)?.network);
        }
        let Some(network) = &self.fallback else { return Err(Error::Overflow) };
        let Self { selection, normalized, kernels, memory, .. } = self;
        network.reset();
        selection.select(normalized, kernels, &**network, memory)?;
        network.set_points(selection.points());
        network.set_surroundings(normalized);
        network.classify(memory, selection.pooled_stn());
        self.prediction.precision = Precision::F32;
        let is_sound = !network.met().overflow && all_finite(&memory.values);
        if is_sound { Ok(()) } else { Err(Error::Overflow) }
    }

    /// Averages the log-probabilities of several draws, which take the place of
    /// logits.
    fn vote(&mut self) -> Result<(), Error> {
        self.votes.begin(&self.normalized);
        for vote in 0..self.votes.n() {
            self.selection.set_seed(self.votes.seed(vote));
            self.votes.turn(vote, &mut self.normalized);
            self.forward_whole()?;
            self.votes.count(&self.memory.values);
        }
        self.votes.result(&mut self.prediction.logits);
        Ok(())
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

fn setup(options: &Options, precision: Precision) -> Result<Setup<'_>, Error> {
    let kernels = choose_kernels(precision, options.kernel)?;
    Ok(Setup {
        precision,
        kernels,
        threads: options.threads,
        t_nets: options.t_nets,
        activation_ranges: options.activation_ranges.as_ref(),
    })
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
