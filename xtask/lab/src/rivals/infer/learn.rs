//! `cargo xtask bench train`: times one step of training the baseline with our program
//! and with PyTorch, in turns.

use super::candidate::{Arithmetic, Candidate, Engine, Job};
use super::comparison::{Entry, compare};
use super::model::{self, worst};
use super::ours::timed;
use super::roster::{Material, TRAINERS, start};
use super::speed_tables::show;
use crate::measure::clock::Cost;
use crate::measure::machine::Machine;
use anyhow::{Context, Result};
use clap::Args;
use formats::atomic;
use formats::weights::WeightsFile;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use train::adam::Adam;
use train::batch::Batch;
use train::layer::Module;
use train::matrix::Matrix;
use train::network::{PointNet, Rates};
use train::shape::Shape;
use xtask::venv::cache_dir;

#[derive(Args, Debug)]
pub struct TrainArgs {
    /// Sizes of the clouds, in points.
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = super::positive,
          default_value = "64,1024")]
    points: Vec<usize>,
    /// Number of clouds in a batch.
    #[arg(long, value_name = "N", value_parser = super::positive, default_value = "24")]
    batch: usize,
    /// Number of rounds. In each round, every program takes several steps at every size; the median
    /// of all steps is shown.
    #[arg(long, value_name = "N", value_parser = super::positive, default_value = "5")]
    rounds: usize,
    /// Do not compare with PyTorch, which is a download of about 5 GB from PyPI.
    #[arg(long)]
    no_torch: bool,
    /// Write all figures, with every step, to this JSON file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Tolerance of losses, relative: two steps of some 30 layers in fp32, batch norms of 24 clouds
/// among them, summed in different orders.
const TOLERANCE: f64 = 1e-2;

#[derive(Serialize)]
struct Report {
    machine: Machine,
    steps: Vec<Entry>,
}

pub fn run(args: &TrainArgs) -> Result<()> {
    let folder = cache_dir().join("train");
    let material = Material { model: folder.join("random.safetensors"), folder };
    model::write_random(&material.model)?;
    let most = args.points.iter().max().copied().unwrap_or(0) * args.batch;
    model::write_cloud(&model::cloud(most), &material.cloud())?;

    let mut candidates = vec![ours(&material)?];
    candidates.extend(start(&TRAINERS, |_| true, !args.no_torch, &material));
    let jobs: Vec<Job> =
        args.points.iter().map(|&points| Job { points, setting: args.batch }).collect();
    let mut steps = Vec::new();
    for &job in &jobs {
        eprintln!("{} clouds of {} points", job.setting, job.points);
        let engine = &mut candidates[0].engine;
        engine.load(job)?;
        let truth = engine.answer()?;
        let error_of = |given: &[f64]| worst(given, &truth, true);
        steps.extend(compare(&mut candidates, job, args.rounds, error_of, |_| TOLERANCE));
    }
    let title = format!("A step of training, batch {}", args.batch);
    show(&title, &steps, &jobs, |job| job.points.to_string());
    if let Some(file) = &args.json {
        let report = Report { machine: Machine::here(), steps };
        atomic::write_bytes(file, serde_json::to_string(&report)? + "\n")?;
    }
    Ok(())
}

struct Learning {
    values: BTreeMap<String, Vec<f32>>,
    n_classes: usize,
    coordinates: Vec<f32>,
    network: PointNet,
    batch: Batch,
    step: u64,
}

const RATES: Rates = Rates { momentum: 0.1, orthogonality: 0.001 };

fn ours(material: &Material) -> Result<Candidate> {
    let mut file = WeightsFile::open(&material.model)?;
    let mut values = BTreeMap::new();
    for name in file.shapes().into_keys() {
        let tensor = file.read(&name)?;
        values.insert(name, tensor.values);
    }
    let n_classes = file.shape("fc3.weight").context("the model has no tensor fc3.weight")?[0];
    let coordinates = WeightsFile::open(&material.cloud())?.read("points")?.values;
    let network = PointNet::new(&Shape::default(), n_classes, 0);
    let batch = Batch::default();
    let engine = Learning { values, n_classes, coordinates, network, batch, step: 0 };
    Ok(Candidate::ours("ours".to_owned(), Arithmetic::F32, engine))
}

impl Learning {
    fn begin(&mut self) {
        self.network = PointNet::new(&Shape::default(), self.n_classes, 0);
        self.step = 0;
        for parameter in self.network.parameters() {
            if let Some(values) = self.values.get(&parameter.name) {
                parameter.value.copy_from_slice(values);
            }
        }
    }

    fn learn(&mut self) -> f64 {
        let loss = self.network.learn(&self.batch, None, RATES);
        self.step += 1;
        let adam = Adam::default();
        adam.step(&mut self.network, self.step, adam.rate);
        loss.total
    }
}

impl Engine for Learning {
    fn load(&mut self, Job { points, setting: clouds }: Job) -> Result<()> {
        let coordinates = self.coordinates[..3 * points * clouds].as_chunks::<3>().0.to_vec();
        let targets =
            |(cloud, class): (usize, usize)| f32::from(u8::from(cloud % self.n_classes == class));
        self.batch = Batch {
            weights: vec![1.0; coordinates.len()],
            coordinates,
            starts: (0..=clouds).map(|cloud| cloud * points).collect(),
            targets: Matrix::from_shape_fn((clouds, self.n_classes), targets),
            ..Batch::default()
        };
        self.begin();
        Ok(())
    }

    fn answer(&mut self) -> Result<Vec<f64>> {
        self.begin();
        Ok(vec![self.learn(), self.learn()])
    }

    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>> {
        timed(repeats, || {
            self.learn();
            Ok(())
        })
    }
}
