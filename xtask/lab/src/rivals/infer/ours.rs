//! Our own engines, in this process.

use super::candidate::{Arithmetic, Candidate, Engine, Job};
use crate::measure::clock::{Cost, measured};
use anyhow::{Context, Result};
use infer_cpu::kernel::{self, KernelName, Kernels};
use infer_cpu::sampler::{FarthestPoints, FpsStart};
use infer_cpu::{Classifier, Normalization, Options, Precision};
use std::hint::black_box;
use std::path::{Path, PathBuf};

/// Runs before those that count, as the rivals' programs have.
const UNCOUNTED: usize = 3;

const SAMPLER: &str = "ours";

/// The classifier with whose answers those of all engines are compared: one thread, and the scalar
/// kernels, which the tests of infer-cpu compare with PyTorch.
pub fn reference(model: &Path) -> Result<Classifier> {
    let kernel = Some(KernelName::Scalar);
    let normalization = Some(Normalization::None);
    Ok(Classifier::load(model, &Options { kernel, normalization, ..Options::default() })?)
}

/// The log-probabilities of all classes.
pub fn log_probabilities(classifier: &mut Classifier, points: &[[f32; 3]]) -> Result<Vec<f64>> {
    let prediction = classifier.classify(points)?;
    Ok((0..prediction.logits.len()).map(|class| prediction.log_probability(class)).collect())
}

fn name(precision: Precision) -> String {
    format!("ours-{precision}")
}

pub fn names() -> Vec<String> {
    Precision::ALL.map(name).into_iter().chain([SAMPLER.to_owned()]).collect()
}

/// Our farthest point sampling, if it `is_wanted`.
pub fn sampler(cloud: &[[f32; 3]], is_wanted: impl Fn(&str) -> bool) -> Option<Candidate> {
    let kernels = kernel::available().next().filter(|_| is_wanted(SAMPLER))?;
    let engine = Sampling {
        kernels,
        sampler: FarthestPoints::default(),
        cloud: cloud.to_vec(),
        job: Job { points: 0, setting: 0 },
        picked: Vec::new(),
    };
    Some(Candidate::ours(SAMPLER.to_owned(), Arithmetic::F32, engine))
}

/// Our classifier in each precision that `is_wanted` by its name.
pub fn classifiers(
    model: &Path,
    cloud: &[[f32; 3]],
    is_wanted: impl Fn(&str) -> bool,
) -> Vec<Candidate> {
    let wanted = Precision::ALL.into_iter().filter(|&precision| is_wanted(&name(precision)));
    let candidate = |precision| {
        let arithmetic = match precision {
            Precision::F32 => Arithmetic::F32,
            Precision::F32Fc16 | Precision::F16 => Arithmetic::Half,
            Precision::I8 => Arithmetic::I8,
        };
        let (model, cloud) = (model.to_path_buf(), cloud.to_vec());
        let engine = Classifying { model, precision, cloud, loaded: None };
        Candidate::ours(name(precision), arithmetic, engine)
    };
    wanted.map(candidate).collect()
}

pub(super) fn timed(repeats: usize, mut once: impl FnMut() -> Result<()>) -> Result<Vec<Cost>> {
    for _ in 0..UNCOUNTED {
        once()?;
    }
    let costs = std::iter::repeat_with(|| {
        let (done, cost) = measured(&mut once);
        done.map(|()| cost)
    });
    costs.take(repeats).collect()
}

struct Sampling {
    kernels: &'static Kernels,
    sampler: FarthestPoints,
    cloud: Vec<[f32; 3]>,
    job: Job,
    picked: Vec<u32>,
}

impl Sampling {
    fn sample(&mut self) {
        let points = &self.cloud[..self.job.points];
        let (n, start) = (self.job.setting, FpsStart::First);
        self.sampler.select(points, n, start, self.kernels, &mut self.picked);
        black_box(&self.picked);
    }
}

impl Engine for Sampling {
    fn load(&mut self, job: Job) -> Result<()> {
        self.job = job;
        Ok(())
    }

    fn answer(&mut self) -> Result<Vec<f64>> {
        self.sample();
        Ok(self.picked.iter().map(|&i| f64::from(i)).collect())
    }

    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>> {
        timed(repeats, || {
            self.sample();
            Ok(())
        })
    }
}

struct Classifying {
    model: PathBuf,
    precision: Precision,
    cloud: Vec<[f32; 3]>,
    /// With the number of points that it is to be given.
    loaded: Option<(Classifier, usize)>,
}

impl Classifying {
    fn loaded(&mut self) -> Result<(&mut Classifier, &[[f32; 3]])> {
        let (classifier, points) = self.loaded.as_mut().context("nothing is loaded")?;
        Ok((classifier, &self.cloud[..*points]))
    }
}

impl Engine for Classifying {
    fn load(&mut self, job: Job) -> Result<()> {
        let options = Options {
            precision: self.precision,
            threads: job.setting,
            normalization: Some(Normalization::None),
            ..Options::default()
        };
        // The old one's threads end first.
        self.loaded = None;
        self.loaded = Some((Classifier::load(&self.model, &options)?, job.points));
        Ok(())
    }

    fn answer(&mut self) -> Result<Vec<f64>> {
        let (classifier, points) = self.loaded()?;
        log_probabilities(classifier, points)
    }

    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>> {
        let (classifier, points) = self.loaded()?;
        timed(repeats, || {
            black_box(classifier.classify(points)?);
            Ok(())
        })
    }
}
