//! The candidates of a comparison.

use crate::measure::clock::Cost;
use anyhow::Result;
use serde::Serialize;
use std::fmt;

/// Does the work that is timed.
pub trait Engine {
    /// Prepares `job`.
    ///
    /// # Errors
    /// If it cannot be done.
    fn load(&mut self, job: Job) -> Result<()>;

    /// Does the loaded job once and returns its answer: log-probabilities, or the
    /// indices of the points kept.
    ///
    /// # Errors
    /// If it cannot be done.
    fn answer(&mut self) -> Result<Vec<f64>>;

    /// Does the loaded job a few times uncounted and then `repeats` times; the cost of
    /// each of the latter.
    ///
    /// # Errors
    /// If it cannot be done.
    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>>;
}

/// The work to do.
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

/// An engine and its description in tables.
pub struct Candidate {
    /// Its name, which `--engines` takes.
    pub name: String,
    /// What it computes with.
    pub arithmetic: Arithmetic,
    /// Whether it is ours.
    pub ours: bool,
    /// Version of its package.
    pub version: String,
    /// The engine itself.
    pub engine: Box<dyn Engine>,
}
