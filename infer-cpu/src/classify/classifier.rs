use std::path::Path;
use std::sync::Arc;

use edgepuck_kernels::{KernelName, Kernels};
use formats::model_card::ModelCard;
use formats::plausible::is_lost;

use crate::classify::choose::check_finite;
use crate::classify::load::{self, Loaded};
use crate::classify::normalize::normalize;
use crate::classify::options::Options;
use crate::classify::prediction::{Prediction, argmax, unknown_classes};
use crate::classify::selection::{Selection, front_pass};
use crate::engine::{Forward, Input, RangeEvents, Scratch};
use crate::error::Error;
use crate::kernel;
use crate::limits::{MOST_POINTS, MOST_THREADS};
use crate::model::source::ModelSource;
use crate::precision::Precision;
use crate::sampler::{SamplerKind, SamplerSpec};

/// A loaded network that classifies clouds.
///
/// Once loaded, it reads no file, and allocates memory only for clouds of more points than
/// [`Options::capacity`].
pub struct Classifier {
    card: ModelCard,
    classes: Vec<Arc<str>>,
    options: Options,
    kernels: &'static Kernels,
    network: Box<dyn Forward>,
    scratch: Scratch,
    selection: Selection,
    finite: Vec<[f64; 3]>,
    /// Height of the ground under the current cloud, if known.
    ground_z: Option<f64>,
    normalized: Vec<[f32; 3]>,
    /// Indices of the points that [`Classifier::sample`] has chosen.
    sampled: Vec<u32>,
    /// For each class, whether its objects are unknown.
    is_unknown: Vec<bool>,
    prediction: Prediction,
}

impl Classifier {
    /// Loads the model file at `path` and packs its weights for `options`.
    ///
    /// # Errors
    /// A file that cannot be read or is not a model; options that the model or this machine does
    /// not support.
    pub fn load(path: &Path, options: &Options) -> Result<Self, Error> {
        Self::from_source(&ModelSource::of(path)?, options)
    }

    /// What to tell a user who asks this model for the classes of clusters of a scan: a model that
    /// scales its clouds has learnt whole objects, without their sizes.
    #[must_use]
    pub fn unsuited_to_clusters(&self) -> Option<String> {
        let found = self.options.normalization.unwrap_or(self.card.normalization);
        (!found.is_metric()).then(|| {
            format!(
                "expected a model of clusters in metres (normalization metric or metric-sight), found \
                 one of whole objects ({found}), which takes cars for airplanes; `--model street-128` \
                 is for clusters"
            )
        })
    }

    /// Loads a model from the bytes of a model file, for example from `include_bytes!`.
    ///
    /// # Errors
    /// As [`Classifier::load`].
    pub fn from_bytes(bytes: &[u8], options: &Options) -> Result<Self, Error> {
        Self::from_source(&ModelSource::from_bytes(bytes), options)
    }

    fn from_source(source: &ModelSource, options: &Options) -> Result<Self, Error> {
        if options.threads > MOST_THREADS {
            return Err(Error::TooManyThreads(options.threads));
        }
        let kernels = choose_kernels(options.precision, options.kernel)?;
        let Loaded { card, network, parts } = load::load(source, options, kernels)?;
        let spec = match &options.sampler {
            Some(spec) => spec.clone(),
            None => SamplerSpec::as_trained(source.name(), &card)?,
        };
        let is_cpl = spec.kind == SamplerKind::Cpl;
        let front = is_cpl.then(|| front_pass(spec.front, &parts)).transpose()?;
        let selection = Selection::new(&spec, front)?;
        Self::around(network, kernels, selection, card, options)
    }

    fn around(
        network: Box<dyn Forward>,
        kernels: &'static Kernels,
        selection: Selection,
        card: ModelCard,
        options: &Options,
    ) -> Result<Self, Error> {
        let classes = class_names(&card, network.n_classes());
        let prediction = Prediction::empty(&classes, card.temperature, options.precision);
        let mut classifier = Self {
            is_unknown: unknown_classes(&card, &classes),
            card,
            classes,
            options: options.clone(),
            kernels,
            scratch: network.scratch(),
            network,
            selection,
            finite: Vec::new(),
            ground_z: None,
            normalized: Vec::new(),
            sampled: Vec::new(),
            prediction,
        };
        classifier.reserve(options.capacity)?;
        Ok(classifier)
    }

    /// A second classifier for one thread, which shares the weights.
    pub(crate) fn twin(&self) -> Result<Self, Error> {
        let options = Options { threads: 1, ..self.options.clone() };
        let threads = |source| Error::Threads { threads: 1, source };
        let network = self.network.twin().map_err(threads)?;
        Self::around(network, self.kernels, self.selection.twin()?, self.card.clone(), &options)
    }

    pub(crate) fn options(&self) -> &Options {
        &self.options
    }

    pub(crate) fn no_prediction(&self) -> Prediction {
        Prediction::empty(&self.classes, self.card.temperature, self.options.precision)
    }

    /// Allocates memory for clouds of up to `n` points.
    ///
    /// # Errors
    /// More than 2^28 points.
    pub fn reserve(&mut self, n: usize) -> Result<(), Error> {
        if n > MOST_POINTS {
            return Err(Error::TooMuchRoom(n));
        }
        self.network.reserve(n);
        self.finite.reserve(n);
        self.normalized.reserve(n);
        self.sampled.reserve(n);
        self.selection.reserve(n, self.kernels, &*self.network, &mut self.scratch)
    }

    /// Class names in the order of the logits.
    #[must_use]
    pub fn classes(&self) -> &[Arc<str>] {
        &self.classes
    }

    /// The metadata of the model.
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

    /// Classifies a cloud of points, `[n, 3]`, in metres. For a model that normalises clouds to the
    /// unit sphere, only shape counts, and any unit will do.
    ///
    /// # Errors
    /// A cloud without points besides lost returns ([`is_lost`]), which are dropped; one with a coordinate
    /// that is not finite, unless [`Options::drop_invalid`] is set; a network whose arithmetic overflows.
    pub fn classify(&mut self, points: &[[f32; 3]]) -> Result<&Prediction, Error> {
        self.classify_on_ground(points, None)
    }

    /// Classifies a cluster above ground at the height `ground_z`, in metres in the cluster's
    /// frame, as a segmentation states it. A model for metres measures heights from there; with
    /// `None` or NaN, from the lowest point.
    ///
    /// # Errors
    /// As [`Classifier::classify`].
    pub fn classify_on_ground(
        &mut self,
        points: &[[f32; 3]],
        ground_z: Option<f32>,
    ) -> Result<&Prediction, Error> {
        self.take(points.iter().map(|point| point.map(f64::from)))?;
        self.ground_z = ground_z.map(f64::from);
        self.predict()
    }

    /// Classifies a cloud whose coordinates need the precision of f64.
    ///
    /// # Errors
    /// As [`Classifier::classify`].
    pub fn classify_f64(&mut self, points: &[[f64; 3]]) -> Result<&Prediction, Error> {
        self.take(points.iter().copied())?;
        self.predict()
    }

    /// The indices of the points that the sampler keeps of a cloud, with repetitions if the sampler
    /// repeats points. The cloud is normalised first.
    ///
    /// # Errors
    /// A cloud without points, or with a coordinate that is not finite.
    pub fn sample(&mut self, points: &[[f64; 3]]) -> Result<&[u32], Error> {
        check_finite(points)?;
        (self.finite, self.ground_z) = (points.to_vec(), None);
        self.check_number()?;
        self.normalize();
        let Self { selection, normalized, kernels, network, scratch, .. } = self;
        let places = selection.select(normalized, kernels, &**network, scratch)?;
        self.sampled.clear();
        self.sampled.extend(places);
        Ok(&self.sampled)
    }

    /// Stores the points of `points` that are no lost returns.
    fn take(&mut self, points: impl Iterator<Item = [f64; 3]>) -> Result<(), Error> {
        self.finite.clear();
        self.ground_z = None;
        self.prediction.n_dropped = 0;
        for (index, point) in points.enumerate() {
            let is_finite = point.iter().all(|x| x.is_finite());
            if is_lost(point) || !is_finite && self.options.drop_invalid {
                self.prediction.n_dropped += 1;
            } else if is_finite {
                self.finite.push(point);
            } else {
                return Err(Error::NotFinite { index, point });
            }
        }
        self.prediction.n_points = self.finite.len();
        self.check_number()
    }

    fn check_number(&self) -> Result<(), Error> {
        match self.finite.len() {
            0 => Err(Error::NoPoints),
            n if u32::try_from(n).is_err() => Err(Error::TooManyPoints(n)),
            _ => Ok(()),
        }
    }

    fn normalize(&mut self) {
        let normalization = self.options.normalization.unwrap_or(self.card.normalization);
        normalize(normalization, &self.finite, self.ground_z, &mut self.normalized);
    }

    fn predict(&mut self) -> Result<&Prediction, Error> {
        self.normalize();
        let events = self.forward()?;
        self.prediction.logits.clone_from(&self.scratch.values);
        self.prediction.n_used = self.selection.points().len();
        self.prediction.n_clipped = events.clipped;
        self.prediction.class = argmax(&self.prediction.logits);
        self.prediction.label = Arc::clone(&self.classes[self.prediction.class]);
        self.prediction.is_unknown = self.is_unknown[self.prediction.class];
        Ok(&self.prediction)
    }

    /// Runs sampler and network on the normalised cloud; the logits are in `scratch.values`
    /// afterwards. Returns how far the cloud left the range of the network's format.
    fn forward(&mut self) -> Result<RangeEvents, Error> {
        let Self { selection, normalized: cloud, kernels, network, scratch, .. } = self;
        scratch.events = RangeEvents::default();
        selection.select(cloud, kernels, &**network, scratch)?;
        let input = Input { points: selection.points(), cloud, pooled_stn: selection.pooled_stn() };
        network.run(&input, scratch);
        let is_sound = !scratch.events.overflow && scratch.values.iter().all(|x| x.is_finite());
        if is_sound { Ok(scratch.events) } else { Err(Error::Overflow) }
    }
}

fn class_names(card: &ModelCard, n_classes: usize) -> Vec<Arc<str>> {
    match card.classes.is_empty() {
        true => (0..n_classes).map(|class| format!("class {class}").into()).collect(),
        false => card.classes.iter().map(|name| name.as_str().into()).collect(),
    }
}

/// The kernels `forced`, or the fastest of this machine that support `precision`.
pub(crate) fn choose_kernels(
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
