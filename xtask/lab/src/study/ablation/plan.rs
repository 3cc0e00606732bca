//! How large the ablations are.

use crate::study::plan;
use anyhow::ensure;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use train::recipe::Recipe;

/// The ablations' sizes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// A remark on the results.
    pub about: String,
    /// Meshes of each class that are learnt from, and tested on, at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_per_class: Option<[u32; 2]>,
    /// Positions of the sensor around each mesh.
    pub views: u32,
    /// The noise's standard deviation, metres; where absent, what the sensor's
    /// maker states.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_m: Option<f64>,
    /// The probability that a return is lost.
    pub dropout: f64,
    /// Points of each packed cloud.
    pub packed_points: u32,
    /// Scans with fewer points are left out, of all datasets.
    pub min_points: u32,
    /// One network of each dataset is trained with each of these.
    pub seeds: Vec<u64>,
    /// Steps of every training.
    pub steps: u32,
    /// How often costs are measured.
    pub cost_rounds: usize,
    /// Meshes on which costs are measured.
    pub cost_meshes: usize,
    /// How all networks are trained, as `train --recipe` takes it.
    pub recipe: Recipe,
}

impl plan::Plan for Plan {
    const FULL: &'static str = include_str!("../../../../../assets/ablations/full.toml");
    const QUICK: &'static str = include_str!("../../../../../assets/ablations/quick.toml");

    fn check(&self) -> anyhow::Result<()> {
        let Self { views, packed_points, min_points, steps, cost_rounds, cost_meshes, .. } = self;
        ensure!((1..=360).contains(views), "views: expected 1 to 360");
        ensure!((1..=1 << 20).contains(packed_points), "packed_points: expected 1 to 2^20");
        ensure!(*min_points > 0 && *steps > 0, "min_points, steps: expected 1 or more");
        ensure!(
            *cost_rounds > 0 && *cost_meshes > 0,
            "cost_rounds, cost_meshes: expected 1 or more"
        );
        self.recipe.check()?;
        let distinct: BTreeSet<u64> = self.seeds.iter().copied().collect();
        let is_valid = !distinct.is_empty() && distinct.len() == self.seeds.len();
        ensure!(is_valid, "seeds: expected one or more, all distinct");
        ensure!(
            self.most_per_class.is_none_or(|most| !most.contains(&0)),
            "most_per_class: expected 1 or more"
        );
        let noise = self.noise_m.unwrap_or(1.0);
        ensure!(noise.is_finite() && noise > 0.0, "noise_m: expected a finite number above 0");
        ensure!(
            self.dropout > 0.0 && self.dropout < 1.0,
            "dropout: expected a share above 0 and below 1"
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::plan::Plan as _;

    #[test]
    fn an_ablation_of_nothing_is_refused() {
        let plan: Plan = plan::read(None, true).unwrap();
        let refused = |plan: Plan, key: &str| {
            let error = plan.check().unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        };
        refused(Plan { dropout: 0.0, ..plan.clone() }, "dropout");
        refused(Plan { noise_m: Some(f64::NAN), ..plan.clone() }, "noise_m");
        refused(Plan { seeds: Vec::new(), ..plan.clone() }, "seeds");
        refused(Plan { seeds: vec![7, 7], ..plan.clone() }, "seeds");
        let alone = Recipe { batch: 1, ..plan.recipe.clone() };
        refused(Plan { recipe: alone, ..plan.clone() }, "batch");
        refused(Plan { views: 0, ..plan }, "views");
    }
}
