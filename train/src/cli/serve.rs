//! `serve`: times training steps for `cargo xtask bench train`. Each request is a line of text, and
//! each answer is a line with a JSON object; `xtask/lab/peers/infer/turns.py` describes the
//! protocol.

use std::collections::BTreeMap;
use std::io::{BufRead as _, Write as _, stdin, stdout};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail};
use cpu_time::ProcessTime;
use formats::weights::WeightsFile;
use serde_json::{Value, json};
use train::adam::Adam;
use train::batch::Batch;
use train::layer::Module;
use train::matrix::Matrix;
use train::network::{PointNet, Rates};
use train::shape::Shape;

/// Flags of `serve`.
#[derive(clap::Args, Debug)]
pub struct ServeArgs {
    /// Model file with the initial weights
    model: PathBuf,
    /// Folder of cloud.safetensors
    folder: PathBuf,
}

/// Number of steps before the timed ones.
const WARM_UP: usize = 3;

const RATES: Rates = Rates { momentum: 0.1, orthogonality: 0.001, step: 0 };

/// Answers requests until the input ends.
pub fn run(args: &ServeArgs) -> anyhow::Result<()> {
    let mut session = Session::open(args)?;
    respond(&json!({ "version": env!("CARGO_PKG_VERSION") }))?;
    for line in stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let answer = session.answer(&words);
        respond(&answer.unwrap_or_else(|error| json!({ "error": format!("{error:#}") })))?;
    }
    Ok(())
}

fn respond(message: &Value) -> anyhow::Result<()> {
    let mut out = stdout();
    writeln!(out, "{message}")?;
    Ok(out.flush()?)
}

struct Session {
    values: BTreeMap<String, Vec<f32>>,
    n_classes: usize,
    points: Vec<f32>,
    network: PointNet,
    batch: Batch,
    step: u64,
}

impl Session {
    fn open(args: &ServeArgs) -> anyhow::Result<Self> {
        let mut file = WeightsFile::open(&args.model)?;
        let mut values = BTreeMap::new();
        for name in file.shapes().into_keys() {
            let tensor = file.read(&name)?;
            values.insert(name, tensor.values);
        }
        let n_classes = file.shape("fc3.weight").context("the model has no tensor fc3.weight")?[0];
        let points = WeightsFile::open(&args.folder.join("cloud.safetensors"))?.read("points")?;
        let network = PointNet::new(&Shape::default(), n_classes, 0);
        let (points, batch) = (points.values, Batch::default());
        Ok(Self { values, n_classes, points, network, batch, step: 0 })
    }

    fn answer(&mut self, words: &[&str]) -> anyhow::Result<Value> {
        match words {
            ["load", points, clouds] => {
                self.load(points.parse()?, clouds.parse()?);
                Ok(json!({}))
            }
            ["answer"] => {
                self.begin();
                Ok(json!({ "answer": [self.learn(), self.learn()] }))
            }
            ["time", repeats] => Ok(self.time(repeats.parse()?)),
            _ => bail!("expected load, answer or time, found `{}`", words.join(" ")),
        }
    }

    fn load(&mut self, points: usize, clouds: usize) {
        let coordinates = self.points[..3 * points * clouds].as_chunks::<3>().0.to_vec();
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
    }

    fn begin(&mut self) {
        self.network = PointNet::new(&Shape::default(), self.n_classes, 0);
        self.step = 0;
        let values = &self.values;
        for parameter in self.network.parameters() {
            if let Some(values) = values.get(&parameter.name) {
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

    fn time(&mut self, repeats: usize) -> Value {
        (0..WARM_UP).for_each(|_| {
            self.learn();
        });
        let (mut wall_ns, mut cpu_ns) = (Vec::new(), Vec::new());
        for _ in 0..repeats {
            let (wall, cpu) = (Instant::now(), ProcessTime::now());
            self.learn();
            wall_ns.push(wall.elapsed().as_nanos() as u64);
            cpu_ns.push(cpu.elapsed().as_nanos() as u64);
        }
        json!({ "cpu_ns": cpu_ns, "wall_ns": wall_ns })
    }
}
