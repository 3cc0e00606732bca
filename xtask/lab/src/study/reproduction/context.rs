//! The plan, the data and the networks that experiments share.

use anyhow::{Context, Result, ensure};
use formats::split::Split;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use train::clouds::Clouds;
use train::recipe::Recipe;

pub struct ExperimentContext {
    pub plan: Plan,
    /// ModelNet40's clouds, or those that replace them.
    pub clouds: PathBuf,
    /// The folder of the scans and surfaces of meshes.
    pub scans: PathBuf,
    pub out: PathBuf,
    pub read: RefCell<BTreeMap<String, Arc<Clouds>>>,
}

impl ExperimentContext {
    /// Checks that the data are large enough for the plan.
    pub fn check(&self) -> Result<()> {
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
    pub fn terms(&self) -> Result<String> {
        #[derive(Serialize)]
        struct Terms<'a> {
            version: &'a str,
            sha256: [String; 4],
            plan: &'a Plan,
        }
        let surface = self.scans("surfaces/surface", Split::Train)?;
        let noisy = self.scans("vlp32c/packed/rotational-noisy", Split::Test)?;
        let all = [self.clouds(Split::Train)?, self.clouds(Split::Test)?, surface, noisy];
        let sha256 = all.map(|clouds| clouds.digest());
        let version = env!("CARGO_PKG_VERSION");
        Ok(toml::to_string(&Terms { version, sha256, plan: &self.plan })?)
    }

    /// One half of ModelNet40's clouds, or of as many as the plan wants.
    pub fn clouds(&self, split: Split) -> Result<Arc<Clouds>> {
        self.remember(&format!("clouds {split}"), || {
            let clouds = Clouds::read(&self.clouds, split, self.plan.most_points())?;
            Ok(match (self.plan.most_per_class, split) {
                (None, _) => clouds,
                (Some([most, _]), Split::Train) | (Some([_, most]), Split::Test) => {
                    clouds.of_each_class(most)
                }
            })
        })
    }

    /// One half of the set `name` of scans or surfaces, such as
    /// `vlp32c/packed/rotational-noisy`.
    pub fn scans(&self, name: &str, split: Split) -> Result<Arc<Clouds>> {
        self.remember(&format!("{name} {split}"), || {
            Ok(Clouds::read(&self.scans.join(name), split, self.plan.most_points())?)
        })
    }

    fn remember(&self, key: &str, read: impl FnOnce() -> Result<Clouds>) -> Result<Arc<Clouds>> {
        if let Some(clouds) = self.read.borrow().get(key) {
            return Ok(Arc::clone(clouds));
        }
        let clouds = Arc::new(read()?);
        self.read.borrow_mut().insert(key.to_owned(), Arc::clone(&clouds));
        Ok(clouds)
    }

    /// The file of the network called `name`.
    pub fn model(&self, name: &str) -> PathBuf {
        self.out.join("models").join(format!("{name}.safetensors"))
    }
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
    /// Front ends of Critical Points Layers.
    pub fronts: Vec<Vec<usize>>,
    /// Points that networks are trained at, of scans and surfaces of meshes.
    pub mesh_points: usize,
    /// The recipe of all networks, before the changes of an experiment.
    pub recipe: Recipe,
}

impl Plan {
    /// The plan in the TOML file `path`, or the full or the quick one.
    pub fn read(path: Option<&Path>, quick: bool) -> Result<Self> {
        let (name, text) = match path {
            Some(path) => {
                let name = path.display().to_string();
                let text = std::fs::read_to_string(path);
                (name.clone(), text.with_context(|| format!("cannot read {name}"))?)
            }
            None if quick => {
                let text = include_str!("../../../../../assets/reproduce/quick.toml");
                ("quick.toml".to_owned(), text.to_owned())
            }
            None => {
                let text = include_str!("../../../../../assets/reproduce/full.toml");
                ("full.toml".to_owned(), text.to_owned())
            }
        };
        Self::parse(&text).context(name)
    }

    pub fn parse(text: &str) -> Result<Self> {
        let plan: Self = toml::from_str(text).context("not a valid plan")?;
        plan.check()?;
        Ok(plan)
    }

    fn check(&self) -> Result<()> {
        self.recipe.check()?;
        let mut counts = self.points.iter().chain(&self.kept).chain(&self.tested_points);
        let are_counts = counts.all(|&n| n > 0) && self.mesh_points > 0;
        let widths = 1..=8192;
        for (is_valid, what) in [
            (are_counts, "points, kept, tested_points, mesh_points: expected 1 or more"),
            (
                !self.points.is_empty() && !self.kept.is_empty(),
                "points, kept: expected one count or more",
            ),
            (
                self.recipe.cpl.is_none(),
                "recipe.cpl: expected none, because `fronts` lists the encoders",
            ),
            (
                self.most_per_class.is_none_or(|most| !most.contains(&0)),
                "most_per_class: expected 1 or more",
            ),
            (self.mesh_steps > 0, "mesh_steps: expected 1 or more"),
            (
                self.fronts.iter().all(|front| front.len() > 1),
                "fronts: expected two layers or more",
            ),
            (
                self.fronts.iter().flatten().all(|width| widths.contains(width)),
                "fronts: expected widths of 1 to 8192",
            ),
        ] {
            ensure!(is_valid, "{what}");
        }
        Ok(())
    }

    /// Points of a cloud that experiments ask for at most.
    fn most_points(&self) -> usize {
        let counts = self.points.iter().chain(&self.tested_points).chain(&self.kept);
        counts.copied().chain([self.mesh_points]).max().unwrap_or(1)
    }

    pub fn at(&self, points: usize) -> Recipe {
        Recipe { points, ..self.recipe.clone() }
    }
}
