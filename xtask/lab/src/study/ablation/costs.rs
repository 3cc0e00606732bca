//! What datasets cost: CPU seconds of making them, in rounds so that what
//! disturbs the machine disturbs all of them.

use super::datasets::make;
use super::effects::DATASETS;
use super::plan::Plan;
use crate::measure::clock::{Spread, Workload, interleave, measured};
use anyhow::Context;
use formats::atomic;
use serde::{Deserialize, Serialize};
use sim_gpu::mesh::tree::MeshEntry;
use std::collections::BTreeMap;
use std::path::Path;

/// CPU seconds of a mesh, with all its views.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    pub median: f64,
    pub least: f64,
    pub most: f64,
}

/// What a mesh costs in each dataset, from `file` or else measured and written
/// to it. Every round makes all datasets of some of `meshes`, one after the
/// other, in `scratch`.
///
/// # Errors
/// As [`make`].
pub fn costs(
    plan: &Plan,
    meshes: &[MeshEntry],
    scratch: &Path,
    file: &Path,
) -> anyhow::Result<BTreeMap<String, Seconds>> {
    if file.is_file() {
        let text = std::fs::read_to_string(file)?;
        return serde_json::from_str(&text).with_context(|| file.display().to_string());
    }
    let some = spread_over(meshes, plan.cost_meshes);
    let mut workloads: Vec<Workload<'_>> = Vec::new();
    for dataset in DATASETS {
        let some = &some;
        workloads.push(Box::new(move || {
            clear(scratch)?;
            let (made, cost) = measured(|| make(dataset, plan, some, scratch));
            made.map(|_| cost)
        }));
    }
    let rounds = interleave(plan.cost_rounds, &mut workloads)?;
    clear(scratch)?;
    let of = |spread: Spread| {
        let [median, least, most] =
            [spread.median, spread.min, spread.max].map(|s| s / some.len() as f64);
        Seconds { median, least, most }
    };
    let named = DATASETS.iter().zip(&rounds);
    let costs = named.map(|((name, _), rounds)| ((*name).to_owned(), of(rounds.cpu_s()))).collect();
    atomic::write_bytes(file, serde_json::to_string_pretty(&costs)?)?;
    Ok(costs)
}

/// `n` of `meshes`, or all, evenly spread over the list and so over classes.
fn spread_over(meshes: &[MeshEntry], n: usize) -> Vec<MeshEntry> {
    let n = n.min(meshes.len());
    (0..n).map(|i| meshes[i * meshes.len() / n].clone()).collect()
}

fn clear(folder: &Path) -> anyhow::Result<()> {
    if folder.exists() {
        std::fs::remove_dir_all(folder)
            .with_context(|| format!("cannot clear {}", folder.display()))?;
    }
    Ok(())
}
