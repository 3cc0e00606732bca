//! The candidates of a comparison.

use crate::measure::clock::Cost;
use anyhow::Result;
use serde::Serialize;

/// Does the work that is timed. Every method fails if the work cannot be done.
pub trait Engine {
    /// Prepares `job`.
    fn load(&mut self, job: Job) -> Result<()>;

    /// Does the loaded job once and returns its answer: log-probabilities, the indices of
    /// the points kept, or losses.
    fn answer(&mut self) -> Result<Vec<f64>>;

    /// Does the loaded job a few times uncounted and then `repeats` times; the cost of
    /// each of the latter.
    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>>;
}

/// The work to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Job {
    /// Points of the cloud.
    pub points: usize,
    /// Threads of a classifier, points that a sampler keeps, clouds of a batch.
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

/// What tables and records say of an engine.
#[derive(Clone, Debug, Serialize)]
pub struct Label {
    /// Its name, which `--engines` takes.
    #[serde(rename = "engine")]
    pub name: String,
    /// What it computes with.
    pub arithmetic: Arithmetic,
    /// Whether it is ours.
    pub ours: bool,
}

/// An engine that takes part in a comparison.
pub struct Candidate {
    /// What tables say of it.
    pub label: Label,
    /// Version of its package.
    pub version: String,
    /// The engine itself.
    pub engine: Box<dyn Engine>,
}

impl Candidate {
    /// One of our own engines.
    pub fn ours(name: String, arithmetic: Arithmetic, engine: impl Engine + 'static) -> Self {
        let label = Label { name, arithmetic, ours: true };
        Self { label, version: env!("CARGO_PKG_VERSION").to_owned(), engine: Box::new(engine) }
    }
}
