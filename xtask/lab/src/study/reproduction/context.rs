//! The plan, the data and the networks that experiments share. A network is trained once and kept for
//! resumed runs.

use crate::study::{plan, resume};
use anyhow::ensure;
use formats::split::Split;
use infer_cpu::sampler::{Resize, SamplerKind, SamplerSpec};
use infer_cpu::{Evaluation, Options};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use train::clouds::Clouds;
use train::evaluate::confusion;
use train::recipe::Recipe;

pub struct ExperimentContext {
    pub plan: Plan,
    /// ModelNet40's clouds, or those that replace them.
    pub clouds: PathBuf,
    pub clouds_are: String,
    /// The folder of the scans and surfaces of meshes.
    pub scans: PathBuf,
    pub meshes_are: String,
    pub out: PathBuf,
    pub read: RefCell<BTreeMap<String, Rc<Clouds>>>,
}

impl ExperimentContext {
    /// Checks that the data are large enough for the plan.
    pub fn check(&self) -> anyhow::Result<()> {
        let (train, test) = (self.clouds(Split::Train)?, self.clouds(Split::Test)?);
        ensure!(
            train.classes == test.classes,
            "--clouds: expected the same classes in both halves"
        );
        let most = self.plan.points.iter().chain(&self.plan.kept).max().copied().unwrap_or(0);
        let surface = self.scans("surfaces/surface", Split::Train)?;
        for (what, clouds, most) in
            [("--clouds", train, most), ("surfaces/surface", surface, self.plan.mesh_points)]
        {
            let n_points = clouds.set.smallest_cloud();
            ensure!(
                most <= n_points,
                "{what}: expected clouds of {most} points or more, found {n_points}"
            );
        }
        Ok(())
    }

    /// All that a report depends on: the program, the plan, the data.
    pub fn terms(&self) -> anyhow::Result<String> {
        #[derive(Serialize)]
        struct Terms<'a> {
            version: &'a str,
            clouds: &'a str,
            clouds_sha256: [String; 2],
            meshes: &'a str,
            meshes_sha256: [String; 2],
            plan: &'a Plan,
        }
        let surface = self.scans("surfaces/surface", Split::Train)?;
        let noisy = self.scans("lidar/packed/rotational-noisy", Split::Test)?;
        let terms = Terms {
            version: env!("CARGO_PKG_VERSION"),
            clouds: &self.clouds_are,
            clouds_sha256: [self.clouds(Split::Train)?, self.clouds(Split::Test)?]
                .map(|clouds| clouds.digest()),
            meshes: &self.meshes_are,
            meshes_sha256: [surface, noisy].map(|clouds| clouds.digest()),
            plan: &self.plan,
        };
        Ok(toml::to_string(&terms)?)
    }

    /// One half of ModelNet40's clouds, or of as many as the plan wants.
    pub fn clouds(&self, split: Split) -> anyhow::Result<Rc<Clouds>> {
        self.remember(&format!("clouds {split}"), || {
            let most = self.plan.most_points();
            let clouds = Clouds::read(&self.clouds, split, most)?;
            Ok(match (self.plan.most_per_class, split) {
                (None, _) => clouds,
                (Some([most, _]), Split::Train) | (Some([_, most]), Split::Test) => {
                    clouds.of_each_class(most)
                }
            })
        })
    }

    /// One half of the set `name` of scans or surfaces, such as
    /// `lidar/packed/rotational-noisy`.
    pub fn scans(&self, name: &str, split: Split) -> anyhow::Result<Rc<Clouds>> {
        self.remember(&format!("{name} {split}"), || {
            Ok(Clouds::read(&self.scans.join(name), split, self.plan.most_points())?)
        })
    }

    fn remember(
        &self,
        key: &str,
        read: impl FnOnce() -> anyhow::Result<Clouds>,
    ) -> anyhow::Result<Rc<Clouds>> {
        if let Some(clouds) = self.read.borrow().get(key) {
            return Ok(Rc::clone(clouds));
        }
        let clouds = Rc::new(read()?);
        self.read.borrow_mut().insert(key.to_owned(), Rc::clone(&clouds));
        Ok(clouds)
    }

    pub fn model(&self, name: &str) -> PathBuf {
        self.out.join("models").join(format!("{name}.safetensors"))
    }

    /// The network called `name`, trained by `recipe` on `clouds` unless it is
    /// there.
    pub fn network(&self, name: &str, recipe: Recipe, clouds: &Clouds) -> anyhow::Result<PathBuf> {
        let out = self.model(name);
        resume::network(&out, name, recipe, clouds)?;
        Ok(out)
    }

    /// The confusion of `model` on the test clouds of the set `name`.
    pub fn test_on(&self, name: &str, model: &Path) -> anyhow::Result<Evaluation> {
        test(model, &*self.scans(name, Split::Test)?, None)
    }
}

/// The sampler `kind` that keeps `points`; a Critical Points Layer keeps what
/// is distinct.
pub fn sampler(kind: SamplerKind, points: usize) -> SamplerSpec {
    SamplerSpec { kind, points, resize: Resize::Truncate, ..SamplerSpec::default() }
}

/// The confusion of `model` on `clouds`, behind `sampler` or as trained.
pub fn test(
    model: &Path,
    clouds: &Clouds,
    sampler: Option<SamplerSpec>,
) -> anyhow::Result<Evaluation> {
    let options = Options { sampler, ..Options::default() };
    Ok(confusion(model, clouds, &options)?)
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub about: String,
    /// Most clouds of each class, to train on and to test with.
    pub most_per_class: Option<[usize; 2]>,
    /// Steps of every training on scans and surfaces of meshes, which differ in
    /// size; `recipe.epochs` counts for clouds.
    pub mesh_steps: u32,
    /// Points that networks are trained at, of ModelNet40's clouds.
    pub points: Vec<usize>,
    /// Points that one network is tested at.
    pub tested_points: Vec<usize>,
    pub kept: Vec<usize>,
    /// Front ends of Critical Points Layers; the first is the paper's.
    pub fronts: Vec<Vec<usize>>,
    /// Points that networks are trained at, of scans and surfaces of meshes.
    pub mesh_points: usize,
    /// Clouds that LIME-3D explains.
    pub explained: usize,
    /// Samples of each cloud, with parts removed.
    pub lime_samples: usize,
    /// Random subsets that critical points are compared with.
    pub draws: u32,
    /// The recipe of all networks, before the changes of an experiment.
    pub recipe: Recipe,
}

impl plan::Plan for Plan {
    const FULL: &'static str = include_str!("../../../../../assets/reproduce/full.toml");
    const QUICK: &'static str = include_str!("../../../../../assets/reproduce/quick.toml");

    fn check(&self) -> anyhow::Result<()> {
        self.recipe.check()?;
        let need = |is_valid: bool, what: &str| {
            ensure!(is_valid, "{what}");
            Ok(())
        };
        let mut counts = self.points.iter().chain(&self.kept).chain(&self.tested_points);
        let are_counts = counts.all(|&n| n > 0) && self.mesh_points > 0;
        need(are_counts, "points, kept, tested_points, mesh_points: expected 1 or more")?;
        let are_some = !self.points.is_empty() && !self.kept.is_empty();
        need(are_some, "points, kept: expected one count or more")?;
        let is_plain = self.recipe.cpl.is_none();
        need(is_plain, "recipe.cpl: expected none, because `fronts` lists the encoders")?;
        let has_clouds = self.most_per_class.is_none_or(|most| !most.contains(&0));
        need(has_clouds, "most_per_class: expected 1 or more")?;
        need(self.mesh_steps > 0 && self.draws > 0, "mesh_steps, draws: expected 1 or more")?;
        need(!self.fronts.is_empty(), "fronts: expected one encoder or more")?;
        let are_deep = self.fronts.iter().all(|front| front.len() > 1);
        need(are_deep, "fronts: expected two layers or more")?;
        let are_wide = self.fronts.iter().flatten().all(|width| (1..=8192).contains(width));
        need(are_wide, "fronts: expected widths of 1 to 8192")?;
        need(self.explained > 0, "explained: expected 1 or more")?;
        need(self.lime_samples > 1, "lime_samples: expected 2 or more")
    }
}

impl Plan {
    /// Points of a cloud that experiments ask for at most.
    pub fn most_points(&self) -> usize {
        let counts = self.points.iter().chain(&self.tested_points).chain(&self.kept);
        counts.copied().chain([self.mesh_points]).max().unwrap_or(1)
    }

    pub fn at(&self, points: usize) -> Recipe {
        Recipe { points, ..self.recipe.clone() }
    }
}
