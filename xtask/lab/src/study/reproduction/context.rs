//! Data and networks that experiments share. A network is trained once and kept
//! for resumed runs.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use anyhow::ensure;
use formats::hash;
use formats::split::Split;
use infer_cpu::sampler::{Resize, SamplerKind, SamplerSpec};
use infer_cpu::{Evaluation, Options};
use serde::Serialize;
use train::clouds::Clouds;
use train::evaluate::confusion;
use train::recipe::Recipe;

use super::plan::Plan;
use crate::study::resume;

/// The data, networks and sizes of all experiments.
pub struct ExperimentContext {
    /// How large they are.
    pub plan: Plan,
    /// ModelNet40's clouds, or those that replace them.
    pub clouds: PathBuf,
    /// What the report calls those clouds.
    pub clouds_are: String,
    /// Scans and surfaces of meshes, as `cargo xtask reproduce` makes them.
    pub scans: PathBuf,
    /// What the report calls the meshes.
    pub meshes_are: String,
    /// The folder of the report and of the networks.
    pub out: PathBuf,
    /// What has been read so far, by name and split.
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
        let digest = |clouds: Rc<Clouds>| {
            let bytes: Vec<u8> = clouds.set.points.iter().flat_map(|x| x.to_le_bytes()).collect();
            hash::of_bytes(&bytes)
        };
        let surface = self.scans("surfaces/surface", Split::Train)?;
        let noisy = self.scans("lidar/packed/rotational-noisy", Split::Test)?;
        let terms = Terms {
            version: env!("CARGO_PKG_VERSION"),
            clouds: &self.clouds_are,
            clouds_sha256: [self.clouds(Split::Train)?, self.clouds(Split::Test)?].map(digest),
            meshes: &self.meshes_are,
            meshes_sha256: [surface, noisy].map(digest),
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

    /// The folder of all networks.
    pub fn models(&self) -> PathBuf {
        self.out.join("models")
    }

    /// Where the network called `name` lies.
    pub fn model(&self, name: &str) -> PathBuf {
        self.models().join(format!("{name}.safetensors"))
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
