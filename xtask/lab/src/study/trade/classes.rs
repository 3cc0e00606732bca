//! The classes that a classifier finds for clouds, and the time it takes.

use super::scans::Cloud;
use crate::measure::clock::Spread;
use crate::measure::energy::Energy;
use anyhow::{Context, Result, ensure};
use edgepuck_program::sampler_config::SamplerConfig;
use edgepuck_program::trade_record::{Part, Row};
use formats::labelled::read_labelled;
use infer_cpu::sampler::SamplerSpec;
use infer_cpu::{Classifier, Options, Precision, Summary, TNets};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::time::Instant;
use xtask::workspace::{file_name, recorded};

/// Clouds whose classification is timed, a round.
const TIMED: usize = 100;

/// Labelled clouds.
pub struct TestSet {
    /// Its name in the rows.
    pub name: String,
    /// The clouds.
    pub clouds: Vec<Cloud>,
    /// Each one's class, by name.
    pub labels: Vec<String>,
}

/// The settings of a classifier.
#[derive(Clone, Debug)]
pub struct Classifying {
    /// The model file.
    pub model: PathBuf,
    /// How points are chosen.
    pub sampler: SamplerConfig,
    /// How many.
    pub points: usize,
    /// What to compute in.
    pub precision: Precision,
    /// The T-Nets to run.
    pub t_nets: TNets,
    /// Threads.
    pub threads: usize,
}

/// The classes found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// The class of each cloud; `None` for a cloud without points.
    pub classes: Vec<Option<String>>,
    /// All logits, one cloud after another.
    pub logits: Vec<f32>,
}

/// What classifications cost.
#[derive(Clone, Debug, Default)]
pub struct Costs {
    /// Wall time of each, milliseconds.
    pub ms: Vec<f64>,
    /// Of all together, if the machine measures it.
    pub joules: Option<f64>,
}

impl TestSet {
    /// Clouds from a packed NPZ with class names, at most `limit` spread over it.
    ///
    /// # Errors
    /// A file that cannot be read, or without clouds or names.
    pub fn read(path: &Path, limit: usize) -> Result<Self> {
        let set = read_labelled(path)?;
        ensure!(!set.is_empty(), "{}: no clouds", path.display());
        let names = set.classes.as_ref();
        let names = names.with_context(|| format!("{}: no key `classes`", path.display()))?;
        let kept = limit.min(set.len());
        let chosen: Vec<usize> = (0..kept).map(|i| i * set.len() / kept).collect();
        Ok(Self {
            name: file_name(path),
            clouds: chosen.iter().map(|&i| set.cloud(i).to_vec()).collect(),
            labels: chosen.iter().map(|&i| names[set.labels[i]].clone()).collect(),
        })
    }

    /// Points of its largest cloud.
    pub fn most_points(&self) -> usize {
        self.clouds.iter().map(Vec::len).max().unwrap_or_default()
    }

    /// How many are answered as labelled.
    pub fn right(&self, answers: &Answers) -> usize {
        let pairs = self.labels.iter().zip(&answers.classes);
        pairs.filter(|(label, class)| class.as_ref() == Some(label)).count()
    }

    /// Fails if `model` does not know one of the classes.
    ///
    /// # Errors
    /// Names model and class.
    pub fn fits(&self, model: &Path) -> Result<()> {
        let classifier = Classifier::load(model, &Options::default())?;
        let known = classifier.classes();
        let unknown = self.labels.iter().find(|label| !known.iter().any(|name| **name == ***label));
        match unknown {
            None => Ok(()),
            Some(class) => anyhow::bail!(
                "{}: expected a model with the class `{class}` of {}; name another with --model",
                model.display(),
                self.name
            ),
        }
    }
}

impl Classifying {
    fn options(&self, capacity: usize) -> Options {
        let SamplerConfig { kind, front, .. } = self.sampler;
        let sampler = SamplerSpec { kind, front, points: self.points, ..SamplerSpec::default() };
        Options {
            precision: self.precision,
            threads: self.threads,
            t_nets: self.t_nets,
            sampler: Some(sampler),
            capacity,
            ..Options::default()
        }
    }

    /// Whether both choose the same points of a cloud.
    pub fn chooses_as(&self, other: &Self) -> bool {
        (self.sampler, self.points) == (other.sampler, other.points)
    }

    /// Loads the model as asked for.
    ///
    /// # Errors
    /// A model that cannot be read, or that lacks what the sampler needs.
    pub fn load(&self, capacity: usize) -> Result<Classifier> {
        Ok(Classifier::load(&self.model, &self.options(capacity))?)
    }

    /// Classifies `clouds`.
    ///
    /// # Errors
    /// As [`Self::load`]; a cloud that cannot be classified.
    pub fn answers(&self, clouds: &[Cloud]) -> Result<Answers> {
        let capacity = clouds.iter().map(Vec::len).max().unwrap_or_default();
        // Answers do not depend on the number of threads.
        let alone = Self { threads: 1, ..self.clone() };
        let some = clouds.len().div_ceil(rayon::current_num_threads()).max(1);
        let parts: Result<Vec<Answers>> = clouds
            .par_chunks(some)
            .map(|some| classified(&mut alone.load(capacity)?, some))
            .collect();
        let mut answers = Answers::default();
        for part in parts? {
            answers.classes.extend(part.classes);
            answers.logits.extend(part.logits);
        }
        Ok(answers)
    }

    /// Times some of `clouds`, spread over all, one after another, and adds them to
    /// `costs`.
    ///
    /// # Errors
    /// As [`Self::answers`].
    pub fn time(&self, clouds: &[Cloud], energy: Option<&Energy>, costs: &mut Costs) -> Result<()> {
        let mut classifier = self.load(clouds.iter().map(Vec::len).max().unwrap_or_default())?;
        let each = clouds.len().div_ceil(TIMED).max(1);
        let timed: Vec<_> = clouds.iter().step_by(each).filter(|cloud| !cloud.is_empty()).collect();
        let Some(first) = timed.first() else { return Ok(()) };
        classifier.classify(first)?;
        let before = energy.map(Energy::now);
        for cloud in timed {
            let start = Instant::now();
            classifier.classify(cloud)?;
            costs.ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let joules = energy.zip(before).map(|(energy, before)| energy.joules_since(&before));
        costs.joules = joules.map(|joules| joules + costs.joules.unwrap_or_default());
        Ok(())
    }

    /// The row of `answers` on `set`, compared with `reference`'s; `model` is what
    /// its file holds.
    pub fn row(
        &self,
        set: &TestSet,
        model: &Summary,
        answers: &Answers,
        reference: &Answers,
    ) -> Row {
        let row = Row {
            part: Part::Classifier,
            test_set: set.name.clone(),
            megabytes: Some(model.bytes(self.precision) as f64 * 1e-6),
            agreement: Some(answers.agreement(reference)),
            logit_error: Some(answers.largest_error(reference)),
            ..Row::default()
        };
        self.named_in(row, model).with_accuracy(set.right(answers), set.clouds.len())
    }

    /// `row` with the names of everything that classifies.
    pub fn named_in(&self, row: Row, model: &Summary) -> Row {
        let has_t_nets = model.stn.is_some() || model.fstn.is_some();
        Row {
            model: self.model_name(),
            model_file: recorded(&self.model),
            sampler: self.sampler.name.to_owned(),
            points: Some(self.points),
            precision: self.precision.to_string(),
            t_nets: if has_t_nets { self.t_nets.to_string() } else { String::new() },
            threads: Some(self.threads),
            ..row
        }
    }

    /// The model's name, without folder and extension.
    fn model_name(&self) -> String {
        self.model.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
    }
}

fn classified(classifier: &mut Classifier, clouds: &[Cloud]) -> Result<Answers> {
    let mut answers = Answers::default();
    for cloud in clouds {
        if cloud.is_empty() {
            answers.classes.push(None);
            continue;
        }
        let prediction = classifier.classify(cloud)?;
        answers.classes.push(Some(prediction.label.to_string()));
        answers.logits.extend(&prediction.logits);
    }
    Ok(answers)
}

impl Costs {
    /// The median of one, milliseconds; none without a cloud to time.
    pub fn median_ms(&self) -> Option<f64> {
        (!self.ms.is_empty()).then(|| Spread::of(self.ms.clone()).median)
    }

    /// Of one, if the machine measures it.
    pub fn joules_each(&self) -> Option<f64> {
        self.joules.map(|all| all / self.ms.len().max(1) as f64)
    }
}

impl Answers {
    /// Share of clouds of which both say the same.
    pub fn agreement(&self, other: &Self) -> f64 {
        let pairs = self.classes.iter().zip(&other.classes);
        pairs.filter(|(a, b)| a == b).count() as f64 / self.classes.len().max(1) as f64
    }

    /// The largest difference of two logits.
    fn largest_error(&self, other: &Self) -> f64 {
        let pairs = self.logits.iter().zip(&other.logits);
        pairs.map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).fold(0.0, f64::max)
    }
}
