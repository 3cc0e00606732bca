//! The sets of a design, read and matched.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::ensure;
use formats::hash;
use formats::split::Split;
use train::clouds::Clouds;
use train::run::MOST_POINTS;

use super::design::Design;

/// Clouds by the name of their set, to train on and to test on.
pub type Sets = BTreeMap<(&'static str, Split), Clouds>;

/// A digest of all coordinates and labels of the set `name`.
pub fn sha256(sets: &Sets, name: &'static str) -> String {
    let mut bytes = Vec::new();
    for split in Split::ALL {
        let set = &sets[&(name, split)].set;
        bytes.extend(set.points.iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend(set.labels.iter().flat_map(|&label| (label as u64).to_le_bytes()));
    }
    hash::of_bytes(&bytes)
}

/// Reads all sets of `design`, which lies in `folder`.
pub fn read(design: &Design, folder: &Path) -> anyhow::Result<Sets> {
    let mut sets = Sets::new();
    for set in &design.sets {
        for split in Split::ALL {
            let clouds = Clouds::read(&folder.join(&set.path), split, MOST_POINTS)?;
            sets.insert((set.name, split), clouds);
        }
    }
    let matched = design.sets.iter().filter(|set| set.matched).map(|set| set.name);
    let matched: Vec<&'static str> = matched.collect();
    for split in Split::ALL {
        keep_common(&mut sets, &matched, split)?;
    }
    let classes: BTreeSet<&[String]> = sets.values().map(|clouds| &clouds.classes[..]).collect();
    ensure!(classes.len() == 1, "expected sets of the same classes, found {} lists", classes.len());
    Ok(sets)
}

/// Leaves out of the matched sets what one of them lacks.
fn keep_common(sets: &mut Sets, matched: &[&'static str], split: Split) -> anyhow::Result<()> {
    let mut common: Option<BTreeSet<String>> = None;
    for &name in matched {
        let names = sets[&(name, split)].set.names.iter().flatten().cloned();
        let names: BTreeSet<String> = names.collect();
        ensure!(!names.is_empty(), "set {name}: expected names, because it is matched");
        common = Some(common.map_or(names.clone(), |common| &common & &names));
    }
    let Some(common) = common else { return Ok(()) };
    ensure!(!common.is_empty(), "expected common clouds of the matched sets ({split}), found none");
    for &name in matched {
        sets.entry((name, split)).and_modify(|clouds| {
            let names = clouds.set.names.iter().flatten().enumerate();
            let kept = names.filter(|(_, name)| common.contains(*name)).map(|(i, _)| i);
            *clouds = clouds.select(&kept.collect::<Vec<_>>());
        });
    }
    Ok(())
}
