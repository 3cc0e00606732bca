//! The classes that a classifier finds for clouds, and the time it takes.

use super::scans::Cloud;
use anyhow::{Context, Result, ensure};
use edgepuck_program::sampler_config::SamplerConfig;
use edgepuck_program::trade_record::{Measurement, Part};
use formats::labelled::read_labelled;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options, Precision, Prediction, Summary, TNets, inspect};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::time::Instant;
use xtask::workspace::{file_name, recorded};

/// Clouds whose classification is timed, a round.
const TIMED: usize = 100;

/// Points of the baseline's clouds.
const AS_THE_BASELINE: usize = 1024;

pub struct TestSet {
    pub name: String,
    pub clouds: Vec<Cloud>,
    pub labels: Vec<String>,
}

#[derive(Clone, Debug)]
pub struct Classifying {
    pub model: PathBuf,
    pub sampler: SamplerConfig,
    pub points: usize,
    pub precision: Precision,
    pub t_nets: TNets,
    pub threads: usize,
}

/// The answers to each cloud; `None` for a cloud without points.
pub type Answers = Vec<Option<Prediction>>;

fn labels(answers: &Answers) -> impl Iterator<Item = Option<&str>> {
    answers.iter().map(|answer| answer.as_ref().map(|prediction| &*prediction.label))
}

pub fn agreement(a: &Answers, b: &Answers) -> f64 {
    labels(a).zip(labels(b)).filter(|(a, b)| a == b).count() as f64 / a.len().max(1) as f64
}

fn largest_error(a: &Answers, b: &Answers) -> f64 {
    let logits = |answers: &Answers| -> Vec<f32> {
        answers.iter().flatten().flat_map(|answer| answer.logits.clone()).collect()
    };
    let pairs = logits(a).into_iter().zip(logits(b));
    pairs.map(|(a, b)| (f64::from(a) - f64::from(b)).abs()).fold(0.0, f64::max)
}

impl TestSet {
    /// Clouds from a packed NPZ with class names, at most `limit` spread over it.
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

    pub fn most_points(&self) -> usize {
        most_points(&self.clouds)
    }

    pub fn right(&self, answers: &Answers) -> usize {
        let pairs = self.labels.iter().zip(labels(answers));
        pairs.filter(|(label, answer)| *answer == Some(label.as_str())).count()
    }

    /// Fails if `model` lacks one of the classes.
    pub fn fits(&self, model: &Path) -> Result<()> {
        let classifier = Classifier::load(model, &Options::default())?;
        let known = classifier.classes();
        for class in &self.labels {
            ensure!(
                known.iter().any(|name| **name == **class),
                "{}: expected a model with the class `{class}` of {}; name another with --model",
                model.display(),
                self.name
            );
        }
        Ok(())
    }
}

impl Classifying {
    /// The sampler and the points that a model was trained with, or random points
    /// where it names none to choose by, in fp32.
    pub fn as_trained(model: &Path) -> Result<Self> {
        let card = inspect(model)?.card;
        let sampler = card.sampler.as_deref().and_then(|name| name.split(':').next());
        Ok(Self {
            model: model.to_owned(),
            sampler: SamplerConfig::of_kind(sampler.map_or(Ok(SamplerKind::Random), str::parse)?),
            points: card.points.unwrap_or(AS_THE_BASELINE),
            precision: Precision::F32,
            t_nets: TNets::Both,
            threads: 1,
        })
    }

    pub fn chooses_as(&self, other: &Self) -> bool {
        (self.sampler, self.points) == (other.sampler, other.points)
    }

    /// Loads the model as asked for, for clouds of at most `capacity` points.
    pub fn load(&self, capacity: usize) -> Result<Classifier> {
        let SamplerConfig { kind, front, .. } = self.sampler;
        let sampler = SamplerSpec { kind, front, points: self.points, ..SamplerSpec::default() };
        let options = Options {
            precision: self.precision,
            threads: self.threads,
            t_nets: self.t_nets,
            sampler: Some(sampler),
            capacity,
            ..Options::default()
        };
        Ok(Classifier::load(&self.model, &options)?)
    }

    pub fn answers(&self, clouds: &[Cloud]) -> Result<Answers> {
        let capacity = most_points(clouds);
        // Answers do not depend on the number of threads.
        let alone = Self { threads: 1, ..self.clone() };
        let share = clouds.len().div_ceil(rayon::current_num_threads()).max(1);
        let classified = |clouds: &[Cloud]| -> Result<Answers> {
            let mut classifier = alone.load(capacity)?;
            let answer = |cloud: &Cloud| match cloud.is_empty() {
                true => Ok(None),
                false => Ok(Some(classifier.classify(cloud)?.clone())),
            };
            clouds.iter().map(answer).collect()
        };
        let parts: Result<Vec<Answers>> = clouds.par_chunks(share).map(classified).collect();
        Ok(parts?.into_iter().flatten().collect())
    }

    /// Times some of `clouds`, spread over all, one after another, and adds them to
    /// `ms`.
    pub fn time(&self, clouds: &[Cloud], ms: &mut Vec<f64>) -> Result<()> {
        let mut classifier = self.load(most_points(clouds))?;
        let each = clouds.len().div_ceil(TIMED).max(1);
        let timed: Vec<_> = clouds.iter().step_by(each).filter(|cloud| !cloud.is_empty()).collect();
        let Some(first) = timed.first() else { return Ok(()) };
        classifier.classify(first)?;
        for cloud in timed {
            let start = Instant::now();
            classifier.classify(cloud)?;
            ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
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
    ) -> Measurement {
        let row = Measurement {
            part: Part::Classifier,
            test_set: set.name.clone(),
            megabytes: Some(model.bytes(self.precision) as f64 * 1e-6),
            agreement: Some(agreement(answers, reference)),
            logit_error: Some(largest_error(answers, reference)),
            ..Measurement::default()
        };
        self.named_in(row, model).with_accuracy(set.right(answers), set.clouds.len())
    }

    /// `row` with the names of everything that classifies.
    pub fn named_in(&self, row: Measurement, model: &Summary) -> Measurement {
        let has_t_nets = model.stn.is_some() || model.fstn.is_some();
        Measurement {
            model: self.model.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            model_file: recorded(&self.model),
            sampler: self.sampler.name.to_owned(),
            points: Some(self.points),
            precision: self.precision.to_string(),
            t_nets: if has_t_nets { self.t_nets.to_string() } else { String::new() },
            threads: Some(self.threads),
            ..row
        }
    }
}

fn most_points(clouds: &[Cloud]) -> usize {
    clouds.iter().map(Vec::len).max().unwrap_or_default()
}
