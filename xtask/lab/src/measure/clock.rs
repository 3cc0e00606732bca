//! The cost of a piece of work.
//!
//! Wall time on a shared machine depends on its other users. The figure to compare is the CPU time of
//! the whole process, with the threads of rayon and lavapipe.

use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};
use std::hint::black_box;
use std::time::Instant;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    pub wall_s: f64,
    /// Seconds of CPU time, all threads together.
    pub cpu_s: f64,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Costs(pub Vec<Cost>);

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The upper median.
    pub median: f64,
    pub min: f64,
    pub max: f64,
}

pub fn measured<T>(work: impl FnOnce() -> T) -> (T, Cost) {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    let answer = work();
    let cost = Cost { wall_s: wall.elapsed().as_secs_f64(), cpu_s: cpu.elapsed().as_secs_f64() };
    (answer, cost)
}

/// Work to compare with other work; each call is one repeat.
pub type Workload<'a> = Box<dyn FnMut() -> anyhow::Result<Cost> + 'a>;

/// A workload of all of `work`, whose results are dropped.
pub fn workload<'a, T>(mut work: impl FnMut() -> anyhow::Result<T> + 'a) -> Workload<'a> {
    Box::new(move || {
        let (answer, cost) = measured(&mut work);
        black_box(answer?);
        Ok(cost)
    })
}

/// Runs all `workloads` once uncounted, then in `rounds` rounds of one repeat each, so that a
/// disturbance of the machine affects all of them.
pub fn interleave(rounds: usize, workloads: &mut [Workload<'_>]) -> anyhow::Result<Vec<Costs>> {
    let mut costs = vec![Costs::default(); workloads.len()];
    for round in 0..=rounds {
        for (workload, costs) in workloads.iter_mut().zip(&mut costs) {
            let cost = workload()?;
            if round > 0 {
                costs.0.push(cost);
            }
        }
    }
    Ok(costs)
}

impl Costs {
    pub fn wall_s(&self) -> Spread {
        Spread::of(self.0.iter().map(|cost| cost.wall_s))
    }

    pub fn cpu_s(&self) -> Spread {
        Spread::of(self.0.iter().map(|cost| cost.cpu_s))
    }
}

impl Spread {
    /// The spread of `figures`; zeros without figures.
    pub fn of(figures: impl IntoIterator<Item = f64>) -> Self {
        let mut figures: Vec<f64> = figures.into_iter().collect();
        figures.sort_unstable_by(f64::total_cmp);
        let at = |i: usize| figures.get(i).copied().unwrap_or(0.0);
        Self { median: at(figures.len() / 2), min: at(0), max: at(figures.len().saturating_sub(1)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_repeat_is_not_counted() {
        let mut calls = 0;
        let workload: Workload<'_> = Box::new(|| {
            calls += 1;
            Ok(Cost { wall_s: f64::from(calls), cpu_s: 0.0 })
        });
        let costs = interleave(3, &mut [workload]).unwrap();
        assert_eq!(costs[0].wall_s(), Spread { median: 3.0, min: 2.0, max: 4.0 });
    }
}
