//! A loaded classifier allocates no memory for clouds of up to its capacity.
//!
//! There is only one test, since the count is that of the whole process with all threads.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "support/tiny_model.rs"]
mod tiny_model;

use std::path::Path;

use formats::model_card::ModelCard;
use formats::rng::StreamKey;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, ClassifierTeam, Options, Precision};
use test_support::IS_EMULATED;
use test_support::allocations::{self, Counting};

#[global_allocator]
static COUNTING: Counting = Counting;

const CAPACITY: usize = 300;

/// Clouds of several sizes, with distinct, repeated and equal points.
fn clouds() -> Vec<Vec<[f32; 3]>> {
    let key = StreamKey::new(0, "no allocation", 0);
    let point = |i: usize| [0, 1, 2].map(|axis| key.unit((3 * i + axis) as u64) as f32);
    let all = [1, 48, 49, 150, CAPACITY, 2, 47, 97, 200];
    let sizes = if IS_EMULATED { &all[2..5] } else { &all[..] };
    // With one point far from the others.
    let stray = (0..CAPACITY).map(|i| if i == 7 { [9.0; 3] } else { point(i) }).collect();
    let distinct = sizes.iter().map(|&n| (0..n).map(point).collect());
    let repeated = sizes.iter().map(|&n| (0..n).map(|i| point(i % 5)).collect());
    let equal = sizes.iter().map(|&n| vec![[0.5; 3]; n]);
    distinct.chain(repeated).chain(equal).chain([stray]).collect()
}

fn allocations(model: &Path, options: &Options, clouds: &[Vec<[f32; 3]>], n: usize) -> usize {
    let mut classifier = Classifier::load(model, options).unwrap();
    let mut total = 0.0;
    let before = allocations::count();
    for cloud in clouds.iter().cycle().take(n) {
        total += classifier.classify(cloud).unwrap().confidence();
    }
    let n_allocations = allocations::count() - before;
    assert!(total > 0.0);
    n_allocations
}

/// Enough classifications to reveal slow growth.
const MANY: usize = if IS_EMULATED { 300 } else { 20_000 };

/// The number of classifications of each cloud.
const ROUNDS: usize = if IS_EMULATED { 1 } else { 2 };

/// The standard test harness is off, because it allocates memory when it reports slow tests.
fn main() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.safetensors");
    let model = tiny_model::write(&path, &tiny_model::tensors(4), &ModelCard::default());
    let clouds = clouds();
    let spec = |kind| SamplerSpec { kind, points: 32, ..SamplerSpec::default() };
    let specs = SamplerKind::ALL.map(spec);
    let mut found = Vec::new();
    // A team includes the code of one thread.
    let teams: &[usize] = if IS_EMULATED { &[3] } else { &[1, 3] };
    for precision in Precision::ALL {
        for &threads in teams {
            for spec in &specs {
                let options = Options {
                    precision,
                    threads,
                    sampler: Some(spec.clone()),
                    capacity: CAPACITY,
                    ..Options::default()
                };
                let n = allocations(&model, &options, &clouds, ROUNDS * clouds.len());
                if n > 0 {
                    found.push(format!("{precision}, {threads} threads, {spec:?}: {n}"));
                }
            }
        }
    }
    let (card, tensors) = tiny_model::sets(4);
    let sets = tiny_model::write(&folder.path().join("sets.safetensors"), &tensors, &card);
    for precision in Precision::ALL {
        let options = Options { precision, threads: 3, capacity: CAPACITY, ..Options::default() };
        let n = allocations(&sets, &options, &clouds, ROUNDS * clouds.len());
        if n > 0 {
            found.push(format!("set abstractions in {precision}: {n}"));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    // Many classifications reveal growth of less than one allocation per cloud.
    let many = Options { capacity: CAPACITY, ..Options::default() };
    assert_eq!(allocations(&model, &many, &clouds, MANY), 0);
    team_allocates_nothing(&model, &clouds);
}

/// A team classifies many clouds, in one thread and in more threads than cores.
fn team_allocates_nothing(model: &Path, clouds: &[Vec<[f32; 3]>]) {
    for threads in [1, 3] {
        let options = Options { threads, capacity: CAPACITY, ..Options::default() };
        let classifier = Classifier::load(model, &options).unwrap();
        let mut team = ClassifierTeam::new(classifier).unwrap();
        let mut total = 0.0;
        let before = allocations::count();
        for _ in 0..ROUNDS {
            let clouds = clouds.iter().map(|cloud| (&cloud[..], None));
            team.classify_many(clouds, |answer| total += answer.unwrap().confidence());
        }
        assert_eq!(allocations::count() - before, 0, "a team of {threads}");
        assert!(total > 0.0);
    }
}
