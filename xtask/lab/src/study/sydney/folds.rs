//! The folds of the benchmark, from files that may hold some of them each.

use anyhow::{Context, ensure};
use formats::labelled::LabelledSet;
use formats::model_card::Normalization;
use formats::split::Split;
use std::collections::BTreeSet;
use std::path::PathBuf;
use train::clouds::Clouds;
use train::run::MOST_POINTS;

/// Objects, and the fold that each is in.
pub struct Folds {
    /// The objects of all files, in metres.
    pub clouds: Clouds,
    /// Which fold each is in.
    pub fold: Vec<u32>,
}

impl Folds {
    /// Reads all `files`. The classes are the sorted labels of the data's source.
    pub fn read(files: &[PathBuf]) -> anyhow::Result<Self> {
        let mut sets = Vec::new();
        for path in files {
            let clouds = Clouds::read_for(Normalization::Metric, path, Split::Train, MOST_POINTS)?;
            let set = clouds.set;
            let lacks =
                |key| format!("{}: {key}: expected one for each cloud, found none", path.display());
            let fold = set.fold.clone().with_context(|| lacks("fold"))?;
            let labels = set.raw_labels.clone().with_context(|| lacks("raw_labels"))?;
            sets.push((set, labels, fold));
        }
        let classes: BTreeSet<&String> = sets.iter().flat_map(|(_, labels, _)| labels).collect();
        let classes: Vec<String> = classes.into_iter().cloned().collect();
        let (mut all, mut fold) = (LabelledSet::default(), Vec::new());
        for (set, labels, folds) in &sets {
            for (i, label) in labels.iter().enumerate() {
                let class = classes.binary_search(label).expect("invariant: all are listed");
                all.push(set.cloud(i), class);
            }
            fold.extend(folds);
        }
        let folds = Self { clouds: Clouds { set: all, classes }, fold };
        let n = folds.numbers().len();
        ensure!(n > 1, "fold: expected two folds or more in all files together, found {n}");
        Ok(folds)
    }

    /// The numbers of the folds, ascending.
    pub fn numbers(&self) -> Vec<u32> {
        self.fold.iter().copied().collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The clouds to learn from where `fold` is tested, and those to test with.
    pub fn split(&self, fold: u32) -> [Clouds; 2] {
        [false, true].map(|is_tested| {
            let is_in = |&i: &usize| (self.fold[i] == fold) == is_tested;
            self.clouds.select(&(0..self.fold.len()).filter(is_in).collect::<Vec<_>>())
        })
    }
}
