//! Farthest point sampling, one thread.

use super::candidate::{Candidate, Job};
use super::comparison::{Entry, compare};
use super::reference::shortfall;
use super::speed_tables::show;

/// From so many points to so many.
const JOBS: [Job; 3] = [
    Job { points: 1024, setting: 128 },
    Job { points: 1024, setting: 64 },
    Job { points: 4096, setting: 128 },
];

/// Points that the jobs need.
pub const MOST_POINTS: usize = 4096;

/// By how much squared distances may fall short: those of f32 coordinates in
/// the unit sphere, subtracted and summed in f32, are off by some 1e-7 of the
/// squared diameter, and the least distance kept here is a hundredth of that.
const TOLERANCE: f64 = 1e-4;

/// Lets `candidates` sample parts of `cloud`, and shows how they did.
pub fn compare_all(candidates: &mut [Candidate], rounds: usize, cloud: &[[f32; 3]]) -> Vec<Entry> {
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
