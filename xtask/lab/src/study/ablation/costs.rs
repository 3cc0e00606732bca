//! What datasets cost: CPU seconds of making them, in rounds so that what
//! disturbs the machine disturbs all of them.

use super::datasets::make;
use super::effects::DATASETS;
use super::plan::Plan;
use crate::measure::clock::{Spread, Workload, interleave, measured};
use crate::study::resume;
use anyhow::Context;
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::collections::BTreeMap;
use std::path::Path;

/// CPU seconds of a mesh with all its views in each dataset, from `file` or else
/// measured and written to it. Every round makes all datasets of some of `meshes`,
/// one after the other, in `scratch`.
pub fn costs(
    plan: &Plan,
    meshes: &[MeshEntry],
    scratch: &Path,
    file: &Path,
) -> anyhow::Result<BTreeMap<String, Spread>> {
    resume::result(file, || {
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
        let each = |seconds: f64| seconds / some.len() as f64;
        let named = DATASETS.iter().zip(&rounds).map(|((name, _), rounds)| {
            let seconds = Spread::of(rounds.0.iter().map(|cost| each(cost.cpu_s)));
            ((*name).to_owned(), seconds)
        });
        Ok(named.collect())
    })
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
