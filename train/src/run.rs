//! A run from recipe to model, in a folder from which it can be resumed.

use std::fs;
use std::path::{Path, PathBuf};

use formats::model_card::ModelCard;
use formats::split::Split;
use formats::{FormatError, atomic};
use indicatif::{ProgressBar, ProgressStyle};
use infer_cpu::{Evaluation, Options, UNKNOWN, energy};

use crate::augment::varied_too;
use crate::calibration::{quantile, temperature};
use crate::clouds::Clouds;
use crate::error::Error;
use crate::evaluate::{confusion, predictions};
use crate::metrics::{Metrics, Row};
use crate::recipe::{Recipe, Sampling};
use crate::trainer::{EpochSummary, Trainer};
use crate::{accuracy_report, batches, checkpoint, init, model_file, negatives};

/// Points that are read from a text file at most: as many as the baseline's
/// files have.
pub const MOST_POINTS: usize = 10_000;

/// How many points of a text file a run needs: the baseline's loader takes the
/// first of them; other samplers and EdgeConv layers take all.
#[must_use]
pub fn points_to_read(recipe: &Recipe) -> usize {
    let is_baseline = recipe.sampling == Sampling::First && recipe.network.edges.is_empty();
    if is_baseline { recipe.points } else { MOST_POINTS }
}

/// One training: a recipe, its data and where the model goes.
pub struct Job<'a> {
    /// How to train.
    pub recipe: Recipe,
    /// What to learn from.
    pub clouds: &'a Clouds,
    /// Where the clouds come from, for errors.
    pub data: &'a str,
    /// What the model's card calls the training set.
    pub data_name: &'a str,
    /// Where the model goes. The run's folder is beside it.
    pub out: &'a Path,
}

impl Job<'_> {
    /// Trains, from wherever an earlier run was interrupted, and writes the
    /// model. `test` is read once, at the end; returns the accuracy on it as a
    /// line of text. Progress goes to standard error.
    ///
    /// # Errors
    /// Data, a recipe or a checkpoint that cannot be used, a loss that is not
    /// finite, what the system reports.
    pub fn run(self, test: Option<&Path>) -> Result<Option<String>, Error> {
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
            let cause =
                format!("expected a batch of {} clouds to learn from, found {n}", recipe.batch);
            return Err(Error::Data { path: data.into(), cause });
        }
        let folder = out.with_extension("run");
        fs::create_dir_all(&folder).map_err(|source| FormatError::io(&folder, source))?;
        atomic::sweep_leftovers(&folder)?;
        let mut run = Run::open(folder, &self, &clouds)?;
        while run.trainer.epoch < run.trainer.recipe.epochs {
            run.epoch(&clouds, &held)?;
        }
        run.finish(&self, test, &clouds, &held)
    }
}

fn check(clouds: &Clouds, recipe: &Recipe, data: &str) -> Result<(), Error> {
    let n_points = clouds.set.smallest_cloud();
    let refuse = |cause: String| Err(Error::Data { path: data.into(), cause });
    // A cluster in metres may have any number of points.
    if !recipe.normalization.is_metric() && n_points < recipe.points {
        let wanted = recipe.points;
        return refuse(format!("expected clouds of {wanted} points or more, found {n_points}"));
    }
    if clouds.classes.len() < 2 {
        return refuse("expected two classes or more, found one".to_owned());
    }
    let missing = (0..clouds.classes.len()).find(|class| !clouds.set.labels.contains(class));
    if let Some(class) = missing {
        let name = &clouds.classes[class];
        return refuse(format!("expected clouds of every class, found none of {class} ({name})"));
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

/// A run and its folder.
struct Run {
    folder: PathBuf,
    trainer: Trainer,
    metrics: Metrics,
    classes: Vec<String>,
    training_set: String,
    /// Of what it learns from.
    digest: String,
}

impl Run {
    /// The run in `folder` as its checkpoint has it, or a new one that learns from
    /// `clouds`.
    fn open(folder: PathBuf, job: &Job<'_>, clouds: &Clouds) -> Result<Self, Error> {
        let classes = job.recipe.classes(&job.clouds.classes);
        let trainer = Trainer::new(job.recipe.clone(), classes.len())?;
        let training_set = job.data_name.to_owned();
        let metrics = Metrics::default();
        let digest = clouds.digest();
        let mut run = Self { folder, trainer, metrics, classes, training_set, digest };
        let path = run.folder.join("checkpoint.safetensors");
        if path.is_file() {
            let notes = checkpoint::read(&path, &mut run.trainer, &run.digest)?;
            eprintln!("resuming after epoch {} of {}", run.trainer.epoch, job.recipe.epochs);
            run.metrics = Metrics::from_notes(&notes)
                .map_err(|cause| FormatError::malformed(&path, "metadata `notes`", cause))?;
        } else if let Some(model) = &job.recipe.init {
            let card = run.card(None);
            let clouds = negatives::added(clouds.clone(), &job.recipe, "learnt", 0);
            init::start(&mut run.trainer, model, &card, &clouds)?;
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
        model_file::write(&current, &mut self.trainer.model, &card)?;
        let validated = if held.is_empty() {
            None
        } else {
            Some(confusion(&current, held, &Options::default())?)
        };
        self.note(epoch, &learnt, validated.as_ref());
        // Without a validation set, the last epoch is taken.
        if validated.is_none() || self.metrics.is_best(epoch, self.trainer.recipe.balance > 0.0) {
            let best = self.folder.join("best.safetensors");
            model_file::write(&best, &mut self.trainer.model, &card)?;
        }
        self.metrics.write(&self.folder)?;
        let notes = self.metrics.to_notes();
        let path = self.folder.join("checkpoint.safetensors");
        checkpoint::write(&path, &mut self.trainer, &self.digest, &notes)
    }

    /// Learns for one epoch, with a progress bar on standard error.
    fn learn(&mut self, clouds: &Clouds) -> Result<EpochSummary, Error> {
        let (epoch, epochs) = (self.trainer.epoch + 1, self.trainer.recipe.epochs);
        let clouds = &negatives::added(clouds.clone(), &self.trainer.recipe, "learnt", epoch);
        let batch = self.trainer.recipe.batch;
        let bar = ProgressBar::new(batches::count(clouds.len(), &self.trainer.recipe) as u64);
        let template = "epoch {prefix} {bar:30} {pos}/{len} {msg} {eta} left";
        bar.set_style(ProgressStyle::with_template(template).expect("invariant: a valid template"));
        bar.set_prefix(format!("{epoch}/{epochs}"));
        let learnt = self.trainer.learn(clouds, |progress| {
            bar.set_position((progress.clouds / batch) as u64);
            let accuracy = 100.0 * progress.accuracy;
            bar.set_message(format!("loss {:.3}, {accuracy:.1} %", progress.loss));
        })?;
        bar.finish_and_clear();
        Ok(learnt)
    }

    fn note(&mut self, epoch: u32, learnt: &EpochSummary, validated: Option<&Evaluation>) {
        let recipe = &self.trainer.recipe;
        let factor = recipe.schedule.factor(f64::from(epoch - 1), recipe.epochs);
        let row = Row {
            epoch,
            rate: recipe.adam.rate * factor,
            loss: learnt.loss,
            accuracy: learnt.accuracy,
            validation_instance: validated.map(Evaluation::instance_accuracy),
            validation_class: validated.map(|found| found.class_accuracy().0),
            seconds: learnt.time.as_secs_f64(),
            clouds_per_second: learnt.clouds as f64 / learnt.time.as_secs_f64(),
        };
        eprintln!("{row}");
        self.metrics.rows.push(row);
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
            edge_radii: recipe.network.edges.iter().map(|edge| edge.radius).collect(),
            training_set: Some(self.training_set.clone()),
            accuracy,
            provenance: Some(format!("edgepuck train, seed {}{from}", recipe.seed)),
            ..ModelCard::default()
        }
    }

    /// Writes the best weights as they are shipped, and reads the test half
    /// once, with those weights.
    fn finish(
        &mut self,
        job: &Job<'_>,
        test: Option<&Path>,
        clouds: &Clouds,
        held: &Clouds,
    ) -> Result<Option<String>, Error> {
        model_file::read(&self.folder.join("best.safetensors"), &mut self.trainer.model)?;
        let shipped = self.folder.join("shipped.safetensors");
        let mut card = self.card(None);
        model_file::ship(&shipped, &mut self.trainer.model, &card)?;
        self.calibrate(&mut card, &shipped, held)?;
        let accuracy = test.map(|path| self.test(&shipped, path, job.data)).transpose()?;
        let activation_ranges = infer_cpu::activation_ranges_of_set(&shipped, &clouds.set)?;
        let card = ModelCard { activation_ranges, accuracy: accuracy.clone(), ..card };
        model_file::ship(&shipped, &mut self.trainer.model, &card)?;
        // A kill before this line leaves files in the run's folder alone, which
        // the next run sweeps.
        fs::rename(&shipped, job.out).map_err(|source| FormatError::io(job.out, source))?;
        Ok(accuracy)
    }

    /// Fits the temperature of `card`, and its largest energy if that is asked for,
    /// to what `model` says of the validation clouds.
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

    fn test(&self, model: &Path, test: &Path, data: &str) -> Result<String, Error> {
        let recipe = &self.trainer.recipe;
        let most_points = points_to_read(recipe);
        let mut clouds = Clouds::read_for(recipe.normalization, test, Split::Test, most_points)?;
        clouds.classes = recipe.classes(&clouds.classes);
        if clouds.classes != self.classes {
            let cause = format!("expected the classes of {data}, found {:?}", clouds.classes);
            return Err(Error::Data { path: test.to_path_buf(), cause });
        }
        Ok(accuracy_report::summary(&confusion(model, &clouds, &Options::default())?, test))
    }
}
