//! How large the experiments are.

use std::path::Path;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use train::recipe::Recipe;

/// The experiments' sizes, as a TOML file says them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// What the report says of it.
    pub about: String,
    /// Clouds of each class that are learnt from at most, and tested on.
    pub most_per_class: Option<[usize; 2]>,
    /// Steps of every training on scans and surfaces of meshes, which differ in
    /// size; `recipe.epochs` counts for clouds.
    pub mesh_steps: u32,
    /// Points that networks are trained at, of ModelNet40's clouds.
    pub points: Vec<usize>,
    /// Points that one network is tested at.
    pub tested_points: Vec<usize>,
    /// Points that samplers keep.
    pub kept: Vec<usize>,
    /// Front ends of Critical Points Layers; the first is the paper's.
    pub fronts: Vec<Vec<usize>>,
    /// Points that networks are trained at, of scans and surfaces of meshes.
    pub mesh_points: usize,
    /// Clouds that LIME-3D explains.
    pub explained: usize,
    /// Clouds with parts taken away, of each.
    pub lime_samples: usize,
    /// Random subsets that critical points are compared with.
    pub draws: u32,
    /// How all networks are trained, but for what an experiment is about.
    pub recipe: Recipe,
}

const QUICK: &str = include_str!("../../../assets/reproduce/quick.toml");
const FULL: &str = include_str!("../../../assets/reproduce/full.toml");

impl Plan {
    /// The plan at `path`, or a bundled one.
    ///
    /// # Errors
    /// A file that is no plan.
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
        plan.recipe.check().with_context(|| name.clone())?;
        plan.check().with_context(|| name)?;
        Ok(plan)
    }

    fn check(&self) -> anyhow::Result<()> {
        let counts = self.points.iter().chain(&self.kept).chain(&self.tested_points);
        ensure!(counts.chain([&self.mesh_points]).all(|&n| n > 0), "0 points");
        ensure!(!self.points.is_empty() && !self.kept.is_empty(), "no points to train at");
        ensure!(self.recipe.cpl.is_none(), "recipe.cpl: front ends are in `fronts`");
        ensure!(self.most_per_class.is_none_or(|most| !most.contains(&0)), "0 clouds of a class");
        ensure!(self.mesh_steps > 0 && self.draws > 0, "0 steps or draws");
        ensure!(!self.fronts.is_empty(), "no front end");
        ensure!(self.fronts.iter().all(|front| front.len() > 1), "a front end of one layer");
        let mut widths = self.fronts.iter().flatten();
        ensure!(widths.all(|width| (1..=8192).contains(width)), "fronts: widths of 1 to 8192");
        ensure!(self.explained > 0 && self.lime_samples > 1, "nothing to explain");
        Ok(())
    }

    /// Points of a cloud that experiments ask for at most.
    pub fn most_points(&self) -> usize {
        let counts = self.points.iter().chain(&self.tested_points).chain(&self.kept);
        counts.copied().chain([self.mesh_points]).max().unwrap_or(1)
    }

    /// The recipe at `points` points.
    pub fn at(&self, points: usize) -> Recipe {
        Recipe { points, ..self.recipe.clone() }
    }

    /// The recipe for `clouds` clouds of meshes: as many epochs as the steps
    /// make.
    pub fn on_meshes(&self, clouds: usize) -> Recipe {
        let steps = (clouds / self.recipe.batch).max(1) as u32;
        Recipe { epochs: self.mesh_steps.div_ceil(steps).max(1), ..self.at(self.mesh_points) }
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
}
