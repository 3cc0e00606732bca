//! Who takes part.

use crate::measure::clock::Cost;
use anyhow::Result;
use serde::Serialize;
use std::fmt;

/// Someone who does the work that is timed.
pub trait Engine {
    /// Makes ready for `job`.
    ///
    /// # Errors
    /// If it cannot be done.
    fn load(&mut self, job: Job) -> Result<()>;

    /// Does what was loaded once; its answer: log-probabilities, or the
    /// indices of the points kept.
    ///
    /// # Errors
    /// If it cannot be done.
    fn answer(&mut self) -> Result<Vec<f64>>;

    /// Does what was loaded, some times uncounted and then `repeats` times;
    /// what each of the latter cost.
    ///
    /// # Errors
    /// If it cannot be done.
    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>>;
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Job {
    /// Points of the cloud.
    pub points: usize,
    /// Threads of a classifier, points that a sampler keeps.
    pub setting: usize,
}

/// What an engine computes with; the order is that of the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Arithmetic {
    /// f32 throughout.
    F32,
    /// f16 or bf16, at least for what is stored.
    Half,
    /// Eight bits for weights and activations.
    I8,
}

impl fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::F32 => "f32",
            Self::Half => "half",
            Self::I8 => "i8",
        })
    }
}

/// A engine and what tables say of it.
pub struct Candidate {
    /// Its name, which `--engines` takes.
    pub name: String,
    /// What it computes with.
    pub arithmetic: Arithmetic,
    /// Whether it is ours.
    pub ours: bool,
    /// Of the package.
    pub version: String,
    /// What runs.
    pub engine: Box<dyn Engine>,
}
