//! How large the experiments are.

use crate::study::plan;
use anyhow::ensure;
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

impl plan::Plan for Plan {
    const FULL: &'static str = include_str!("../../../../../assets/reproduce/full.toml");
    const QUICK: &'static str = include_str!("../../../../../assets/reproduce/quick.toml");

    fn check(&self) -> anyhow::Result<()> {
        self.recipe.check()?;
        let counts = self.points.iter().chain(&self.kept).chain(&self.tested_points);
        ensure!(
            counts.chain([&self.mesh_points]).all(|&n| n > 0),
            "points, kept, tested_points, mesh_points: expected 1 or more"
        );
        ensure!(
            !self.points.is_empty() && !self.kept.is_empty(),
            "points, kept: expected one count or more"
        );
        ensure!(
            self.recipe.cpl.is_none(),
            "recipe.cpl: expected none, because `fronts` lists the encoders"
        );
        ensure!(
            self.most_per_class.is_none_or(|most| !most.contains(&0)),
            "most_per_class: expected 1 or more"
        );
        ensure!(self.mesh_steps > 0 && self.draws > 0, "mesh_steps, draws: expected 1 or more");
        ensure!(!self.fronts.is_empty(), "fronts: expected one encoder or more");
        ensure!(
            self.fronts.iter().all(|front| front.len() > 1),
            "fronts: expected two layers or more"
        );
        let mut widths = self.fronts.iter().flatten();
        ensure!(
            widths.all(|width| (1..=8192).contains(width)),
            "fronts: expected widths of 1 to 8192"
        );
        ensure!(
            self.explained > 0 && self.lime_samples > 1,
            "explained: expected 1 or more; lime_samples: 2 or more"
        );
        Ok(())
    }
}

impl Plan {
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
