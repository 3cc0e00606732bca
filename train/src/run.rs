//! A run in its folder: epochs, each with a checkpoint that resumes the run, and the finished model.

use std::fs;
use std::path::{Path, PathBuf};

use formats::model_card::ModelCard;
use formats::{FormatError, atomic};
use infer_cpu::Options;

use crate::calibration::temperature;
use crate::clouds::Clouds;
use crate::error::Error;
use crate::evaluate::{evaluate, predictions};
use crate::job::{Job, Progress};
use crate::metrics::{Epoch, is_best, to_csv};
use crate::trainer::Trainer;
use crate::{accuracy_report, checkpoint, init, model_file};

/// A run in its folder.
pub struct Run<'a> {
    folder: PathBuf,
    /// The network in training.
    pub trainer: Trainer,
    epochs: Vec<Epoch>,
    classes: &'a [String],
    training_set: &'a str,
    digest: String,
    report: &'a mut dyn FnMut(Progress<'_>),
}

impl<'a> Run<'a> {
    /// Opens the run in `folder` at its checkpoint, or starts a new run that learns from `clouds`.
    pub fn open(
        folder: PathBuf,
        job: &Job<'a>,
        clouds: &Clouds,
        report: &'a mut dyn FnMut(Progress<'_>),
    ) -> Result<Self, Error> {
        let classes = &job.clouds.classes;
        let mut run = Self {
            folder,
            trainer: Trainer::new(job.recipe.clone(), classes.len()),
            epochs: Vec::new(),
            classes,
            training_set: job.data_name,
            digest: clouds.digest(),
            report,
        };
        let path = run.folder.join("checkpoint.safetensors");
        let resumes = path.is_file() && !job.overwrite;
        if resumes {
            run.epochs = checkpoint::read(&path, &mut run.trainer, &run.digest)?;
            let (epoch, epochs) = (run.trainer.epoch, job.recipe.epochs);
            (run.report)(Progress::Resumed { epoch, epochs });
        } else if let Some(model) = &job.recipe.init {
            let card = run.card();
            init::start(&mut run.trainer.model, model, &card)?;
        }
        // Not before everything is checked: a run that cannot begin leaves the finished one.
        if path.is_file() && !resumes {
            fs::remove_file(&path).map_err(|source| FormatError::io(&path, source))?;
        }
        let text = run.trainer.recipe.to_toml()?;
        atomic::write_bytes(&run.folder.join("recipe.toml"), &text)?;
        Ok(run)
    }

    /// Trains and validates one epoch, and writes a checkpoint.
    pub fn epoch(&mut self, clouds: &Clouds, held: &Clouds) -> Result<(), Error> {
        let mut epoch = self.trainer.learn(clouds)?;
        let current = self.folder.join("current.safetensors");
        let card = self.card();
        model_file::write(&current, &mut self.trainer.model, &card)?;
        if !held.set.is_empty() {
            let found = evaluate(&current, held, &Options::default())?;
            epoch.validation_instance = Some(found.instance_accuracy());
            epoch.validation_class = Some(found.class_accuracy().0);
        }
        (self.report)(Progress::Epoch(&epoch));
        let is_best = is_best(&epoch, &self.epochs, self.trainer.recipe.balance);
        self.epochs.push(epoch);
        // Without a validation set, the last epoch is taken.
        if held.set.is_empty() || is_best {
            let best = self.folder.join("best.safetensors");
            model_file::write(&best, &mut self.trainer.model, &card)?;
        }
        atomic::write_bytes(&self.folder.join("metrics.csv"), to_csv(&self.epochs))?;
        let path = self.folder.join("checkpoint.safetensors");
        checkpoint::write(&path, &mut self.trainer, &self.digest, &self.epochs)
    }

    fn card(&self) -> ModelCard {
        let recipe = &self.trainer.recipe;
        let (sampler, points) = match &recipe.cpl {
            Some(cpl) => ("cpl", cpl.keep),
            None => (recipe.sampling.name(), recipe.points),
        };
        let from = recipe.init.as_deref().and_then(Path::file_stem);
        let from = from.map(|name| format!(", from {}", name.to_string_lossy()));
        let from = from.unwrap_or_default();
        ModelCard {
            classes: self.classes.to_vec(),
            normalization: recipe.normalization,
            unknown_classes: recipe.unknown.clone(),
            sampler: Some(sampler.to_owned()),
            points: Some(points),
            edge_radii: recipe.network.edges.iter().map(|edge| edge.radius).collect(),
            training_set: Some(self.training_set.to_owned()),
            provenance: Some(format!("edgepuck train, seed {}{from}", recipe.seed)),
            ..ModelCard::default()
        }
    }

    /// Writes the best weights in the form for release, and measures them once on the test clouds.
    pub fn finish(
        &mut self,
        job: &Job<'_>,
        test: Option<&(&Path, Clouds)>,
        clouds: &Clouds,
        held: &Clouds,
    ) -> Result<Option<String>, Error> {
        model_file::read(&self.folder.join("best.safetensors"), &mut self.trainer.model)?;
        let shipped = self.folder.join("shipped.safetensors");
        let mut card = self.card();
        model_file::ship(&shipped, &mut self.trainer.model, &card)?;
        if !card.unknown_classes.is_empty() {
            let found = predictions(&shipped, held, &Options::default())?;
            let logits: Vec<Vec<f32>> = found.into_iter().map(|found| found.logits).collect();
            card.temperature = temperature(&logits, &held.set.labels);
        }
        let mut accuracy = None;
        if let Some((path, clouds)) = test {
            let found = evaluate(&shipped, clouds, &Options::default())?;
            accuracy = Some(accuracy_report::summary(&found, self.classes.len(), path));
        }
        let activation_ranges = infer_cpu::activation_ranges_of_set(&shipped, &clouds.set)?;
        let card = ModelCard { activation_ranges, accuracy: accuracy.clone(), ..card };
        model_file::ship(&shipped, &mut self.trainer.model, &card)?;
        // An interruption before this line leaves files in the run's folder only, and the next run
        // removes them.
        fs::rename(&shipped, job.out).map_err(|source| FormatError::io(job.out, source))?;
        Ok(accuracy)
    }
}
