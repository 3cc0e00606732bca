//! The sets of a design, read and matched.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, ensure};
use formats::hash;
use formats::split::Split;
use train::clouds::Clouds;
use train::run::MOST_POINTS;

use super::design::Design;

/// What is learnt from, and what is tested on.
pub struct TrainTestSplit {
    pub train: Clouds,
    pub test: Clouds,
}

impl TrainTestSplit {
    fn of(&mut self, split: Split) -> &mut Clouds {
        match split {
            Split::Train => &mut self.train,
            Split::Test => &mut self.test,
        }
    }

    /// A digest of all coordinates and labels.
    pub fn sha256(&self) -> String {
        let mut bytes = Vec::new();
        for clouds in [&self.train, &self.test] {
            bytes.extend(clouds.set.points.iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend(clouds.set.labels.iter().flat_map(|&label| (label as u64).to_le_bytes()));
        }
        hash::of_bytes(&bytes)
    }
}

/// Reads all sets of `design`, which lies in `folder`, by name.
///
/// # Errors
/// Data that cannot be used; sets of other classes than the first.
pub fn read(design: &Design, folder: &Path) -> anyhow::Result<BTreeMap<String, TrainTestSplit>> {
    let mut sets = BTreeMap::new();
    for set in &design.sets {
        let half = |split| Clouds::read(&folder.join(&set.path), split, MOST_POINTS);
        let set_split = TrainTestSplit { train: half(Split::Train)?, test: half(Split::Test)? };
        sets.insert(set.name.clone(), set_split);
    }
    for split in Split::ALL {
        keep_common(&mut sets, design, split)?;
    }
    let classes = sets.values().flat_map(|split| [&split.train.classes, &split.test.classes]);
    let distinct: BTreeSet<&Vec<String>> = classes.collect();
    ensure!(
        distinct.len() == 1,
        "expected sets of the same classes, found {} lists",
        distinct.len()
    );
    Ok(sets)
}

/// Leaves out of the matched sets what one of them lacks.
fn keep_common(
    sets: &mut BTreeMap<String, TrainTestSplit>,
    design: &Design,
    split: Split,
) -> anyhow::Result<()> {
    let mut common: Option<BTreeSet<String>> = None;
    let matched: Vec<&str> =
        design.sets.iter().filter(|set| set.matched).map(|set| set.name.as_str()).collect();
    for &name in &matched {
        let clouds = sets.get_mut(name).map(|set| set.of(split));
        let names = clouds.and_then(|clouds| clouds.set.names.clone());
        let names =
            names.with_context(|| format!("set {name}: expected names, because it is matched"))?;
        let names = BTreeSet::from_iter(names);
        common = Some(match common {
            None => names,
            Some(common) => common.intersection(&names).cloned().collect(),
        });
    }
    let Some(common) = common else { return Ok(()) };
    ensure!(!common.is_empty(), "expected common clouds of the matched sets ({split}), found none");
    for name in matched {
        let Some(clouds) = sets.get_mut(name).map(|set| set.of(split)) else { continue };
        let names = clouds.set.names.iter().flatten().enumerate();
        let kept: Vec<usize> =
            names.filter(|(_, name)| common.contains(*name)).map(|(i, _)| i).collect();
        *clouds = clouds.select(&kept);
    }
    Ok(())
}
