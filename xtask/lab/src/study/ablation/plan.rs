//! How large the ablations are.

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The ablations' sizes, as a TOML file says them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// What is to be known of the results.
    pub about: String,
    /// Meshes of each class that are learnt from, and tested on, at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_per_class: Option<[u32; 2]>,
    /// Places around each mesh from which the sensor looks.
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
    /// A network of each dataset each.
    pub seeds: Vec<u64>,
    /// Steps of every training.
    pub steps: u32,
    /// How often costs are measured.
    pub cost_rounds: usize,
    /// Meshes on which they are.
    pub cost_meshes: usize,
    /// How all networks are trained, as `train --recipe` takes it.
    pub recipe: toml::Table,
}

const FULL: &str = include_str!("../../../../../assets/ablations/full.toml");
const QUICK: &str = include_str!("../../../../../assets/ablations/quick.toml");

impl Plan {
    /// The plan at `path`, or a bundled one.
    ///
    /// # Errors
    /// A file that is no plan, with the key and the cause.
    pub fn read(path: Option<&Path>, quick: bool) -> anyhow::Result<Self> {
        let (name, text) = match path {
            Some(path) => {
                let name = path.display().to_string();
                let text = std::fs::read_to_string(path);
                (name.clone(), text.with_context(|| format!("cannot read {name}"))?)
            }
            None if quick => ("quick.toml".to_owned(), QUICK.to_owned()),
            None => ("full.toml".to_owned(), FULL.to_owned()),
        };
        let plan: Self = toml::from_str(&text).with_context(|| format!("{name}: no plan"))?;
        plan.check().with_context(|| name)?;
        Ok(plan)
    }

    fn check(&self) -> anyhow::Result<()> {
        let Self { views, packed_points, min_points, steps, cost_rounds, cost_meshes, .. } = self;
        ensure!((1..=360).contains(views), "views: between 1 and 360");
        ensure!((1..=1 << 20).contains(packed_points), "packed_points: between 1 and 2^20");
        ensure!(*min_points > 0 && *steps > 0, "min_points, steps: at least 1");
        ensure!(*cost_rounds > 0 && *cost_meshes > 0, "cost_rounds, cost_meshes: at least 1");
        ensure!(!self.seeds.is_empty(), "seeds: none");
        ensure!(self.most_per_class.is_none_or(|most| !most.contains(&0)), "most_per_class: 0");
        let noise = self.noise_m.unwrap_or(1.0);
        ensure!(noise.is_finite() && noise > 0.0, "noise_m: finite, above 0");
        ensure!(self.dropout > 0.0 && self.dropout < 1.0, "dropout: above 0, below 1");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bundled_plans_are_plans() {
        for quick in [false, true] {
            Plan::read(None, quick).unwrap();
        }
    }

    #[test]
    fn an_ablation_of_nothing_is_refused() {
        let plan = Plan::read(None, true).unwrap();
        let refused = |plan: Plan, key: &str| {
            let error = plan.check().unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        };
        refused(Plan { dropout: 0.0, ..plan.clone() }, "dropout");
        refused(Plan { noise_m: Some(f64::NAN), ..plan.clone() }, "noise_m");
        refused(Plan { seeds: Vec::new(), ..plan.clone() }, "seeds");
        refused(Plan { views: 0, ..plan }, "views");
    }
}
