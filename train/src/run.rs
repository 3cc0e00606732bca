//! A run from a recipe to a model. Its folder keeps a checkpoint that resumes it.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use formats::model_card::ModelCard;
use formats::split::Split;
use formats::{FormatError, atomic};
use infer_cpu::{Evaluation, Options, UNKNOWN, energy};

use crate::augment::varied_too;
use crate::calibration::{quantile, temperature};
use crate::clouds::Clouds;
use crate::error::Error;
use crate::evaluate::{confusion, predictions};
use crate::metrics::{Epoch, Metrics};
use crate::recipe::{Recipe, Sampling};
use crate::trainer::{EpochSummary, Trainer};
use crate::{accuracy_report, batches, checkpoint, init, model_file, negatives};

/// Largest number of points that are read from a text file: the number in the baseline's files.
pub const MOST_POINTS: usize = 10_000;

/// The number of points of a text file that a run needs. The baseline's loader takes the first
/// points; other samplers and EdgeConv layers need all of them.
#[must_use]
pub fn points_to_read(recipe: &Recipe) -> usize {
    let is_baseline = recipe.sampling == Sampling::First && recipe.network.edges.is_empty();
    if is_baseline { recipe.points } else { MOST_POINTS }
}

/// Trains one model.
pub struct Job<'a> {
    /// The settings of the training.
    pub recipe: Recipe,
    /// The training and validation clouds.
    pub clouds: &'a Clouds,
    /// Where the clouds come from, for errors.
    pub data: &'a str,
    /// The name of the training set on the model's card.
    pub data_name: &'a str,
    /// The model file. The run's folder is beside it.
    pub out: &'a Path,
    /// Whether to begin anew instead of resuming the run in that folder.
    pub overwrite: bool,
}

/// What a run reports while it trains.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'a> {
    /// The run continues after the last epoch of its checkpoint.
    Resumed {
        /// The number of finished epochs.
        epoch: u32,
        /// The number of epochs of the whole run.
        epochs: u32,
    },
    /// A step of an epoch is finished.
    Step {
        /// The epoch, counted from 1.
        epoch: u32,
        /// The number of epochs of the whole run.
        epochs: u32,
        /// The number of finished steps of the epoch.
        step: usize,
        /// The number of steps of the epoch.
        steps: usize,
        /// The epoch so far.
        summary: &'a EpochSummary,
    },
    /// An epoch is finished and validated.
    Epoch(&'a Epoch),
}

impl Job<'_> {
    /// Trains, continuing an interrupted run, and writes the model. At the end, measures the model
    /// on the clouds at `test` and returns the accuracy as a line of text. Calls `report` as the
    /// run goes on.
    pub fn run(
        self,
        test: Option<&Path>,
        report: &mut dyn FnMut(Progress<'_>),
    ) -> Result<Option<String>, Error> {
        let Job { recipe, clouds: all, data, out, .. } = &self;
        recipe.check()?;
        check(all, recipe, data)?;
        let (learnt, held) = all.split_validation(recipe.validation, recipe.seed);
        let (clouds, mut held) = (all.select(&learnt), all.select(&held));
        if recipe.varies_objects() && !held.is_empty() {
            held = varied_too(&held, recipe);
        }
        let held = negatives::added(held, recipe, "held", 0);
        if batches::count(clouds.len(), recipe) == 0 {
            let n = clouds.len();
            let batch = recipe.batch;
            let cause = format!(
                "expected a batch of {batch} clouds to learn from, found {n}: set a smaller `batch` \
                 in the recipe"
            );
            return Err(Error::Data { path: data.into(), cause });
        }
        // A run ends with its test, which would fail after hours.
        let classes = recipe.classes(&all.classes);
        let test = test.map(|path| Test::read(recipe, &classes, path, data)).transpose()?;
        let folder = out.with_extension("run");
        fs::create_dir_all(&folder).map_err(|source| FormatError::io(&folder, source))?;
        let _lock = lock(&folder)?;
        atomic::sweep_leftovers(&folder)?;
        let mut run = Run::open(folder, &self, &clouds, report)?;
        while run.trainer.epoch < run.trainer.recipe.epochs {
            run.epoch(&clouds, &held)?;
        }
        run.finish(&self, test.as_ref(), &clouds, &held)
    }
}

/// The clouds on which a finished network is measured.
struct Test<'a> {
    path: &'a Path,
    clouds: Clouds,
    /// The number of classes of the clouds themselves, without one that the recipe adds.
    n_classes: usize,
}

impl<'a> Test<'a> {
    /// Reads the clouds at `path`, which must have the `classes` of a network for `data`.
    fn read(
        recipe: &Recipe,
        classes: &[String],
        path: &'a Path,
        data: &str,
    ) -> Result<Self, Error> {
        let most_points = points_to_read(recipe);
        let mut clouds = Clouds::read_for(recipe.normalization, path, Split::Test, most_points)?;
        let n_classes = clouds.classes.len();
        clouds.classes = recipe.classes(&clouds.classes);
        if clouds.classes != classes {
            let cause = format!("expected the classes of {data}, found {:?}", clouds.classes);
            return Err(Error::Data { path: path.to_path_buf(), cause });
        }
        Ok(Self { path, clouds, n_classes })
    }

    /// The accuracy of `model` as a line of text.
    fn accuracy(&self, model: &Path) -> Result<String, Error> {
        let confusion = confusion(model, &self.clouds, &Options::default())?;
        Ok(accuracy_report::summary(&confusion, self.n_classes, self.path))
    }
}

/// Locks the run's `folder` until the returned file is dropped, or the process ends.
fn lock(folder: &Path) -> Result<File, Error> {
    // The file stays: if it were removed, two processes could hold locks on two files of its name.
    let path = folder.join("lock");
    let file = File::options().create(true).truncate(false).write(true).open(&path);
    let file = file.map_err(|source| FormatError::io(&path, source))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(Error::Busy { path: folder.to_path_buf() }),
        // Some network file systems have no locks.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
    }
}

fn check(clouds: &Clouds, recipe: &Recipe, data: &str) -> Result<(), Error> {
    let n_points = clouds.set.smallest_cloud();
    let refuse = |cause: String| Err(Error::Data { path: data.into(), cause });
    // A cluster in metres may have any number of points.
    if !recipe.normalization.is_metric() && n_points < recipe.points {
        let wanted = recipe.points;
        return refuse(format!(
            "expected clouds of {wanted} points or more, found {n_points}: give at most {n_points} \
             by --points, or a recipe for clusters, such as --recipe street-128"
        ));
    }
    if clouds.classes.len() < 2 {
        return refuse("expected two classes or more, found one".to_owned());
    }
    let missing = (0..clouds.classes.len()).find(|class| !clouds.set.labels.contains(class));
    if let Some(class) = missing {
        let name = &clouds.classes[class];
        let way = if recipe.normalization.is_metric() {
            "more --sweeps of gen-scenes, or a recipe that places it, give some"
        } else {
            "make the data with a mesh of it in the train split, or with a smaller --min-points"
        };
        return refuse(format!("expected clouds of every class, found none of {name}: {way}"));
    }
    if recipe.negatives > 0.0 && clouds.classes.iter().any(|name| name == UNKNOWN) {
        return refuse(format!("expected no class `{UNKNOWN}` beside the recipe's negatives"));
    }
    let lacks = |name: &&String| !recipe.classes(&clouds.classes).contains(name);
    if let Some(name) = recipe.unknown.iter().find(lacks) {
        return Err(Error::Recipe {
            key: "unknown",
            cause: format!("expected some of the classes {:?}, found `{name}`", clouds.classes),
        });
    }
    Ok(())
}

struct Run<'a> {
    folder: PathBuf,
    trainer: Trainer,
    metrics: Metrics,
    classes: Vec<String>,
    training_set: String,
    digest: String,
    report: &'a mut dyn FnMut(Progress<'_>),
}

impl<'a> Run<'a> {
    /// Opens the run in `folder` at its checkpoint, or starts a new run that learns from `clouds`.
    fn open(
        folder: PathBuf,
        job: &Job<'_>,
        clouds: &Clouds,
        report: &'a mut dyn FnMut(Progress<'_>),
    ) -> Result<Self, Error> {
        let classes = job.recipe.classes(&job.clouds.classes);
        let trainer = Trainer::new(job.recipe.clone(), classes.len())?;
        let training_set = job.data_name.to_owned();
        let metrics = Metrics::default();
        let digest = clouds.digest();
        let mut run = Self { folder, trainer, metrics, classes, training_set, digest, report };
        let path = run.folder.join("checkpoint.safetensors");
        let resumes = path.is_file() && !job.overwrite;
        if resumes {
            let notes = checkpoint::read(&path, &mut run.trainer, &run.digest)?;
            let (epoch, epochs) = (run.trainer.epoch, job.recipe.epochs);
            (run.report)(Progress::Resumed { epoch, epochs });
            run.metrics = Metrics::from_notes(&notes)
                .map_err(|cause| FormatError::malformed(&path, "metadata `notes`", cause))?;
        } else if let Some(model) = &job.recipe.init {
            let card = run.card(None);
            let clouds = negatives::added(clouds.clone(), &job.recipe, "learnt", 0);
            init::start(&mut run.trainer, model, &card, &clouds)?;
        }
        // Not before everything is checked: a run that cannot begin leaves the finished one.
        if path.is_file() && !resumes {
            fs::remove_file(&path).map_err(|source| FormatError::io(&path, source))?;
        }
        let text = run.trainer.recipe.to_toml()?;
        atomic::write_bytes(&run.folder.join("recipe.toml"), &text)?;
        Ok(run)
    }

    fn epoch(&mut self, clouds: &Clouds, held: &Clouds) -> Result<(), Error> {
        let epoch = self.trainer.epoch + 1;
        let learnt = self.learn(clouds)?;
        let current = self.folder.join("current.safetensors");
        let card = self.card(None);
        let tensors = self.trainer.tensors();
        model_file::write_tensors(&current, tensors.clone(), &card)?;
        let validated = if held.is_empty() {
            None
        } else {
            Some(confusion(&current, held, &Options::default())?)
        };
        let row = self.row(epoch, &learnt, validated.as_ref());
        (self.report)(Progress::Epoch(&row));
        self.metrics.epochs.push(row);
        // Without a validation set, the last epoch is taken.
        if validated.is_none() || self.metrics.is_best(epoch, self.trainer.recipe.balance > 0.0) {
            let best = self.folder.join("best.safetensors");
            model_file::write_tensors(&best, tensors, &card)?;
        }
        self.metrics.write(&self.folder)?;
        let notes = self.metrics.to_notes();
        let path = self.folder.join("checkpoint.safetensors");
        checkpoint::write(&path, &mut self.trainer, &self.digest, &notes)
    }

    fn learn(&mut self, clouds: &Clouds) -> Result<EpochSummary, Error> {
        let recipe = &self.trainer.recipe;
        let (epoch, epochs, batch) = (self.trainer.epoch + 1, recipe.epochs, recipe.batch);
        let clouds = &negatives::added(clouds.clone(), recipe, "learnt", epoch);
        let steps = batches::count(clouds.len(), recipe);
        self.trainer.learn(clouds, |summary| {
            let step = summary.clouds / batch;
            (self.report)(Progress::Step { epoch, epochs, step, steps, summary });
        })
    }

    fn row(&self, epoch: u32, learnt: &EpochSummary, validated: Option<&Evaluation>) -> Epoch {
        let recipe = &self.trainer.recipe;
        let factor = recipe.schedule.factor(f64::from(epoch - 1), recipe.epochs);
        Epoch {
            epoch,
            rate: recipe.adam.rate * factor,
            loss: learnt.loss,
            accuracy: learnt.accuracy,
            validation_instance: validated.map(Evaluation::instance_accuracy),
            validation_class: validated.map(|found| found.class_accuracy().0),
            seconds: learnt.time.as_secs_f64(),
            clouds_per_second: learnt.clouds as f64 / learnt.time.as_secs_f64(),
        }
    }

    fn card(&self, accuracy: Option<String>) -> ModelCard {
        let recipe = &self.trainer.recipe;
        let (sampler, points) = match (&recipe.cpl, recipe.sampling) {
            (Some(cpl), _) => ("cpl", cpl.keep),
            (None, Sampling::First) => ("first", recipe.points),
            (None, Sampling::Random) => ("random", recipe.points),
            (None, Sampling::Fps) => ("fps", recipe.points),
        };
        let from = recipe.init.as_deref().and_then(Path::file_stem);
        let from = from.map(|name| format!(", from {}", name.to_string_lossy()));
        let from = from.unwrap_or_default();
        ModelCard {
            classes: self.classes.clone(),
            normalization: recipe.normalization,
            unknown_classes: recipe.unknown.clone(),
            outlier_filter: recipe.outlier_filter,
            sampler: Some(sampler.to_owned()),
            points: Some(points),
            abstractions: recipe
                .network
                .abstractions
                .iter()
                .map(|abstraction| (abstraction.centres, abstraction.radius))
                .collect(),
            edge_radii: recipe.network.edges.iter().map(|edge| edge.radius).collect(),
            training_set: Some(self.training_set.clone()),
            accuracy,
            provenance: Some(format!("edgepuck train, seed {}{from}", recipe.seed)),
            ..ModelCard::default()
        }
    }

    /// Writes the best weights in the form for release, and measures them once on the test clouds.
    fn finish(
        &mut self,
        job: &Job<'_>,
        test: Option<&Test<'_>>,
        clouds: &Clouds,
        held: &Clouds,
    ) -> Result<Option<String>, Error> {
        model_file::read(&self.folder.join("best.safetensors"), &mut self.trainer.model)?;
        let shipped = self.folder.join("shipped.safetensors");
        let mut card = self.card(None);
        model_file::ship(&shipped, &mut self.trainer.model, &card)?;
        self.calibrate(&mut card, &shipped, held)?;
        let accuracy = test.map(|test| test.accuracy(&shipped)).transpose()?;
        let activation_ranges = infer_cpu::activation_ranges_of_set(&shipped, &clouds.set)?;
        let card = ModelCard { activation_ranges, accuracy: accuracy.clone(), ..card };
        model_file::ship(&shipped, &mut self.trainer.model, &card)?;
        // An interruption before this line leaves files in the run's folder only, and the next run
        // removes them.
        fs::rename(&shipped, job.out).map_err(|source| FormatError::io(job.out, source))?;
        Ok(accuracy)
    }

    /// Fits the temperature of `card`, and its largest energy if the recipe wants one, to the
    /// answers of `model` to the validation clouds.
    fn calibrate(&self, card: &mut ModelCard, model: &Path, held: &Clouds) -> Result<(), Error> {
        let recipe = &self.trainer.recipe;
        if !recipe.is_calibrated() {
            return Ok(());
        }
        let found = predictions(model, held, &Options::default())?;
        let logits: Vec<Vec<f32>> = found.iter().map(|found| found.logits.clone()).collect();
        card.temperature = temperature(&logits, &held.set.labels);
        if let Some(share) = recipe.keep_known {
            let is_known = |class: usize| !recipe.unknown.contains(&self.classes[class]);
            let known = found
                .iter()
                .zip(&held.set.labels)
                .filter(|(found, label)| is_known(**label) && is_known(found.class));
            let energies = known.map(|(found, _)| energy(&found.logits, card.temperature));
            card.unknown_energy = quantile(energies.collect(), share);
        }
        Ok(())
    }
}
