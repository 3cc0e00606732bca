use crate::config::DatasetConfig;
use sim_gpu::internals::mesh::tree::MeshEntry;
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
