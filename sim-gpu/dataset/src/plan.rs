use crate::config::DatasetConfig;
use crate::record::Entry;
use edgepuck_mesh::tree::MeshEntry;
use serde::{Deserialize, Serialize};
use sim_gpu::Caster;
use std::path::Path;

/// A dataset, or a part of one, to be made.
#[derive(Clone, Copy)]
pub struct Plan<'a> {
    /// The folder of the dataset.
    pub out: &'a Path,
    /// The settings of the dataset.
    pub config: &'a DatasetConfig,
    /// All meshes of the dataset.
    pub meshes: &'a [MeshEntry],
    /// The part to make: (number from 0, number of parts). By default it is the whole dataset.
    pub part: Option<(u32, u32)>,
    /// How a dataset that is in the folder already is treated. It is refused by default.
    pub begin: Begin,
}

/// How a dataset that is in the folder already is treated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Begin {
    /// It is refused.
    #[default]
    Fresh,
    /// It is continued.
    Resume,
    /// It is removed first.
    Overwrite,
}

impl<'a> Plan<'a> {
    /// The whole dataset of `meshes` with the settings `config` in the folder `out`, which must
    /// not hold a dataset yet.
    #[must_use]
    pub fn new(out: &'a Path, config: &'a DatasetConfig, meshes: &'a [MeshEntry]) -> Self {
        Self { out, config, meshes, part: None, begin: Begin::Fresh }
    }
}

/// The conditions of a run. A run is resumed only if they are equal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Terms {
    /// The tool's version.
    pub version: String,
    /// The settings of the dataset.
    pub config: DatasetConfig,
    /// The adapter's name.
    pub adapter: String,
    /// A digest of the entries of the meshes and of the names of their files.
    pub meshes: String,
    /// The part of the meshes: (number from 0, number of parts).
    pub shard: Option<(u32, u32)>,
}

impl Terms {
    /// The terms of a run over `meshes`, the part of `plan`.
    pub(crate) fn new(plan: &Plan, meshes: &[MeshEntry], caster: &Caster) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            config: plan.config.clone(),
            adapter: caster.name().to_owned(),
            meshes: digest(meshes.iter().map(|mesh| (mesh.into(), mesh.relative.as_str()))),
            shard: plan.part,
        }
    }
}

/// A digest of the meshes of a run, which does not depend on the contents of their files.
pub(crate) fn digest<'a>(meshes: impl Iterator<Item = (Entry, &'a str)>) -> String {
    let mut lines: Vec<String> = meshes
        .map(|(Entry { class, split, name }, source)| format!("{class}/{split}/{name} {source}\n"))
        .collect();
    lines.sort_unstable();
    formats::hash::of_bytes(lines.concat().as_bytes())
}
