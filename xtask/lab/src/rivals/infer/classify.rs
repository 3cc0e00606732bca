//! The jobs: classifying, by points and threads, and farthest point sampling.

use super::candidate::{Arithmetic, Candidate, Job};
use super::comparison::{Entry, compare};
use super::model::{shortfall, worst};
use super::ours::log_probabilities;
use super::speed_tables::show;
use crate::measure::clock::Spread;
use anyhow::Result;
use infer_cpu::Classifier;

/// Tolerance of log-probabilities in f32. Engines sum in different orders; over this model's layers
/// that gives some 1e-6.
const F32_TOLERANCE: f64 = 1e-4;

/// Tolerance of others, over the range of the reference's log-probabilities: not a verdict on their
/// accuracy, which the tables show, but on whether they ran this model at all.
const REDUCED_TOLERANCE: f64 = 0.25;

/// Lets `candidates` classify parts of `cloud` of all sizes in `points` with each
/// number of `threads`, and shows how they did.
pub fn classify_all(
    candidates: &mut [Candidate],
    points: &[usize],
    threads: &[usize],
    rounds: usize,
    (reference, cloud): (&mut Classifier, &[[f32; 3]]),
) -> Result<Vec<Entry>> {
    let mut entries = Vec::new();
    for &threads in threads {
        let jobs: Vec<Job> = points.iter().map(|&n| Job { points: n, setting: threads }).collect();
        for &job in &jobs {
            eprintln!("{} points, {}", job.points, in_words(threads));
            let truth = log_probabilities(reference, &cloud[..job.points])?;
            let range = Spread::of(truth.iter().copied());
            let tolerance = |arithmetic| match arithmetic {
                Arithmetic::F32 => F32_TOLERANCE,
                Arithmetic::Half | Arithmetic::I8 => REDUCED_TOLERANCE * (range.max - range.min),
            };
            let error_of = |given: &[f64]| worst(given, &truth, false);
            entries.extend(compare(candidates, job, rounds, error_of, tolerance));
        }
        let title = format!("PointNet by points, {}", in_words(threads));
        show(&title, &entries, &jobs, |job| job.points.to_string());
    }
    Ok(entries)
}

fn in_words(threads: usize) -> String {
    format!("{threads} thread{}", if threads == 1 { "" } else { "s" })
}

/// Numbers of points before and after sampling.
const JOBS: [Job; 3] = [
    Job { points: 1024, setting: 128 },
    Job { points: 1024, setting: 64 },
    Job { points: 4096, setting: 128 },
];

pub const MOST_POINTS: usize = 4096;

/// Tolerance of squared distances: those of f32 coordinates in the unit sphere, subtracted and
/// summed in f32, are off by some 1e-7 of the squared diameter, and the least distance kept here is
/// a hundredth of that.
const TOLERANCE: f64 = 1e-4;

/// Lets `candidates` sample parts of `cloud`, and shows how they did.
pub fn sample_all(candidates: &mut [Candidate], rounds: usize, cloud: &[[f32; 3]]) -> Vec<Entry> {
    let mut entries = Vec::new();
    for job in JOBS {
        eprintln!("sampling {} of {} points", job.setting, job.points);
        let error_of = |kept: &[f64]| shortfall(&cloud[..job.points], kept, job.setting);
        entries.extend(compare(candidates, job, rounds, error_of, |_| TOLERANCE));
    }
    let heading = |job: &Job| format!("{}->{}", job.points, job.setting);
    show("Farthest point sampling", &entries, &JOBS, heading);
    entries
}
