//! Classifying: by points, at each number of threads.

use super::cloud::Cloud;
use super::contest::{Entry, hold};
use super::entrant::{Arithmetic, Entrant, Job};
use super::grid::Grid;
use super::judge::{Judge, worst};
use crate::measure::clock::Spread;
use anyhow::Result;

/// How far log-probabilities in f32 may be from the judge's. Engines sum in
/// different orders; over this model's layers that gives some 1e-6.
const F32_TOLERANCE: f64 = 1e-4;

/// How far others may be, over the range of the judge's log-probabilities: not
/// a verdict on their accuracy, which the tables show, but on whether they ran
/// this model at all.
const REDUCED_TOLERANCE: f64 = 0.25;

/// Lets `entrants` classify parts of `cloud` of all sizes in `points` with each
/// number of `threads`, and shows how they did.
///
/// # Errors
/// If the judge cannot.
pub fn contest(
    entrants: &mut [Entrant],
    points: &[usize],
    threads: &[usize],
    rounds: usize,
    (judge, cloud): (&Judge, &Cloud),
) -> Result<Vec<Entry>> {
    let mut entries = Vec::new();
    for &threads in threads {
        let jobs: Vec<Job> = points.iter().map(|&n| Job { points: n, setting: threads }).collect();
        for &job in &jobs {
            eprintln!("{} points, {}", job.points, in_words(threads));
            let truth = judge.log_probabilities(cloud.first(job.points))?;
            let range = Spread::of(truth.iter().copied());
            let tolerance = |arithmetic| match arithmetic {
                Arithmetic::F32 => F32_TOLERANCE,
                Arithmetic::Half | Arithmetic::I8 => REDUCED_TOLERANCE * (range.max - range.min),
            };
            entries.extend(hold(entrants, job, rounds, |given| worst(given, &truth), tolerance));
        }
        let title = format!("PointNet by points, {}", in_words(threads));
        Grid::new(title, &entries, jobs, |job| job.points.to_string()).show();
    }
    Ok(entries)
}

fn in_words(threads: usize) -> String {
    format!("{threads} thread{}", if threads == 1 { "" } else { "s" })
}
