//! `cargo xtask ablate objects`: scans of meshes, each row by flags of `gen-dataset`.

use super::{Network, Score, Study, StudyArgs, check_rows, measure};
use crate::measure::clock::{Workload, measured};
use crate::study::datasets::{self, as_even_grid, keep_at_most};
use crate::study::{plan, resume};
use anyhow::{Context, ensure};
use edgepuck_dataset::{DatasetConfig, MeshEntry, SetConfig, Variant, discover};
use edgepuck_program::Outcome;
use edgepuck_program::flags::need_folder_of_meshes;
use edgepuck_program::gen_dataset::report_failures;
use formats::split::Split;
use infer_cpu::Options;
use serde::{Deserialize, Serialize};
use sim_gpu::Caster;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use train::clouds::Clouds;
use train::evaluate::confusion;
use train::recipe::Recipe;
use train::run::MOST_POINTS;

#[derive(clap::Args)]
pub struct ObjectsArgs {
    /// Folder of meshes, as for gen-dataset [default: built-in shapes]
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,

    #[command(flatten)]
    study: StudyArgs,
}

/// Built-in shapes of each class, to train on and to test with.
const SHAPES: [u32; 2] = [40, 10];

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Plan {
    about: String,
    /// Most meshes of each class, to train on and to test with.
    #[serde(skip_serializing_if = "Option::is_none")]
    most_per_class: Option<[u32; 2]>,
    /// Flags of `gen-dataset` that all rows have.
    flags: String,
    /// One network of each row is trained with each of these.
    seeds: Vec<u64>,
    steps: u32,
    cost_rounds: usize,
    /// Meshes on which costs are measured.
    cost_meshes: usize,
    /// The recipe of all networks, as for `train --recipe`.
    recipe: Recipe,
    /// The first is what the others are compared with.
    row: Vec<Row>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    name: String,
    #[serde(default)]
    flags: String,
    #[serde(default)]
    source: Source,
    /// The row that it is compared with, if not the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    beside: Option<String>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Source {
    #[default]
    Scans,
    /// Scans by an even grid of as many beams.
    EvenGrid,
    /// Samples of the surface of whole meshes.
    Surface,
    Seen,
}

impl plan::Plan for Plan {
    const FULL: &'static str = include_str!("../../../../../assets/ablations/full.toml");
    const QUICK: &'static str = include_str!("../../../../../assets/ablations/quick.toml");

    fn check(&self) -> anyhow::Result<()> {
        let names = || self.row.iter().map(|row| row.name.as_str());
        check_rows(&self.seeds, self.cost_rounds, names(), None)?;
        ensure!(self.steps > 0 && self.cost_meshes > 0, "steps, cost_meshes: expected 1 or more");
        let most = self.most_per_class.unwrap_or(SHAPES);
        ensure!(!most.contains(&0), "most_per_class: expected 1 or more");
        self.recipe.check()?;
        for row in &self.row {
            self.config(row).with_context(|| format!("row \"{}\"", row.name))?;
            let is_known = row.beside.iter().all(|beside| names().any(|name| name == beside));
            ensure!(is_known, "row \"{}\": beside: expected the name of a row", row.name);
        }
        Ok(())
    }
}

impl Plan {
    /// The dataset of `row`. All have noisy scans alone, so that points are drawn by one key.
    fn config(&self, row: &Row) -> anyhow::Result<DatasetConfig> {
        let mut config = datasets::config(&format!("{} {}", self.flags, row.flags))?;
        let [SetConfig { sensor, .. }] = &mut config.sets[..] else {
            anyhow::bail!("flags: expected one sensor (--sensor)");
        };
        if row.source == Source::EvenGrid {
            *sensor = as_even_grid(sensor.profile().clone())?.into();
        }
        config.variants = vec![Variant::Noisy];
        Ok(config)
    }

    /// Makes the dataset of `row` in `out`; returns the clouds, as `train --data` takes them, and
    /// the number of meshes that failed.
    fn make(
        &self,
        row: usize,
        meshes: &[MeshEntry],
        out: &Path,
    ) -> anyhow::Result<(PathBuf, usize)> {
        let (config, source) = (self.config(&self.row[row])?, self.row[row].source);
        Ok(match source {
            Source::Scans | Source::EvenGrid => {
                let set = config.sets[0].name.clone();
                let manifest = datasets::scans(config, &Caster::cpu(), meshes, out)?;
                // All rows are of the same meshes: the first names the failures.
                if row == 0 {
                    report_failures(&manifest.failures);
                }
                let clouds = format!("packed/{set}-{}", Variant::Noisy.name());
                (out.join(clouds), manifest.failures.len())
            }
            Source::Surface => {
                (out.join("surface"), datasets::surfaces(&config, false, meshes, out)?)
            }
            Source::Seen => (out.join("seen"), datasets::surfaces(&config, true, meshes, out)?),
        })
    }
}

struct Objects {
    plan: Plan,
    meshes: Vec<MeshEntry>,
    /// By row and split. All rows but whole surfaces have the same views.
    clouds: BTreeMap<(usize, Split), Clouds>,
}

pub fn run(args: &ObjectsArgs) -> anyhow::Result<Outcome> {
    need_folder_of_meshes(args.meshes.as_deref())?;
    let (plan, out) = (args.study.plan::<Plan>()?, &args.study.out);
    keep_terms(&plan, args.meshes.as_deref(), out)?;
    let per_class = plan.most_per_class.unwrap_or(SHAPES);
    let folder = datasets::meshes(args.meshes.as_deref(), &out.join("work/shapes"), per_class)?;
    let mut meshes = discover(&folder, 0)?;
    if let Some(most) = plan.most_per_class {
        keep_at_most(most, &mut meshes);
    }
    let (mut clouds, mut failures) = (BTreeMap::new(), 0);
    for (i, row) in plan.row.iter().enumerate() {
        eprintln!("row \"{}\": {} meshes", row.name, meshes.len());
        let data = out.join("work/data").join(super::folder_name(&row.name));
        let made = plan.make(i, &meshes, &data);
        let (path, failed) = made.with_context(|| format!("row \"{}\"", row.name))?;
        failures += failed;
        for split in Split::ALL {
            clouds.insert((i, split), Clouds::read(&path, split, MOST_POINTS)?);
        }
    }
    // Whole meshes have no views.
    let of_views: Vec<usize> =
        (0..plan.row.len()).filter(|&i| plan.row[i].source != Source::Surface).collect();
    for split in Split::ALL {
        keep_common(&mut clouds, &of_views, split)?;
    }
    measure(&Objects { plan, meshes, clouds }, out)?;
    Ok(if failures > 0 { Outcome::SomeFailed } else { Outcome::Success })
}

fn keep_terms(plan: &Plan, meshes: Option<&Path>, out: &Path) -> anyhow::Result<()> {
    #[derive(Serialize)]
    struct Terms<'a> {
        version: &'a str,
        meshes: String,
        plan: &'a Plan,
    }
    let meshes = match meshes {
        Some(folder) => folder.canonicalize()?.display().to_string(),
        None => "built-in shapes".to_owned(),
    };
    let text = toml::to_string(&Terms { version: env!("CARGO_PKG_VERSION"), meshes, plan })?;
    resume::keep_terms(&text, &out.join("terms.toml"))
}

/// Leaves out of `rows` the views that one of them lacks.
fn keep_common(
    clouds: &mut BTreeMap<(usize, Split), Clouds>,
    rows: &[usize],
    split: Split,
) -> anyhow::Result<()> {
    let names = |clouds: &Clouds| clouds.set.names.iter().flatten().cloned().collect();
    let views = rows.iter().map(|&row| names(&clouds[&(row, split)]));
    let common: BTreeSet<String> =
        views.reduce(|a: BTreeSet<String>, b| &a & &b).unwrap_or_default();
    ensure!(!common.is_empty(), "expected views that all rows have ({split}), found none");
    for &row in rows {
        clouds.entry((row, split)).and_modify(|clouds| {
            let names = clouds.set.names.iter().flatten().enumerate();
            let kept = names.filter(|(_, name)| common.contains(*name)).map(|(i, _)| i);
            *clouds = clouds.select(&kept.collect::<Vec<_>>());
        });
    }
    Ok(())
}

impl Study for Objects {
    const NAME: &'static str = "ablations";

    fn seeds(&self) -> &[u64] {
        &self.plan.seeds
    }

    fn rows(&self) -> Vec<&str> {
        self.plan.row.iter().map(|row| row.name.as_str()).collect()
    }

    fn beside(&self, row: usize) -> usize {
        let beside = self.plan.row[row].beside.as_ref();
        beside.and_then(|name| self.plan.row.iter().position(|row| row.name == *name)).unwrap_or(0)
    }

    fn goal(&self) -> &str {
        &self.plan.row[0].name
    }

    fn lesson(&self, row: usize, seed: u64) -> anyhow::Result<(Recipe, Clouds)> {
        let clouds = self.clouds[&(row, Split::Train)].clone();
        let recipe = Recipe { seed, ..self.plan.recipe.clone() };
        Ok((resume::of_steps(recipe, self.plan.steps, clouds.len()), clouds))
    }

    fn scores(&self, network: &Network<'_>, tested_on: &str, _: u64) -> anyhow::Result<Vec<Score>> {
        let row = self.rows().iter().position(|name| *name == tested_on);
        let clouds = &self.clouds[&(row.context("no such row")?, Split::Test)];
        let found = confusion(&network.path, clouds, &Options::default())?;
        let (right, of) = (found.correct(), found.total());
        Ok(vec![Score { class: "all".to_owned(), right, of, auroc: None }])
    }

    fn cost_rounds(&self) -> usize {
        self.plan.cost_rounds
    }

    fn scanning(&self, row: usize, _: u64) -> anyhow::Result<(Workload<'_>, usize)> {
        // Evenly spread over the list and so over classes.
        let n = self.plan.cost_meshes.min(self.meshes.len());
        let some: Vec<MeshEntry> =
            (0..n).map(|i| self.meshes[i * self.meshes.len() / n].clone()).collect();
        let scan = move || {
            let folder = tempfile::tempdir()?;
            let (made, cost) = measured(|| self.plan.make(row, &some, folder.path()));
            made.map(|_| cost)
        };
        Ok((Box::new(scan), n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::plan::Plan as _;

    #[test]
    fn a_plan_that_cannot_be_run_is_refused() {
        let record = include_str!("../../../../../assets/reports/ablations/plan.toml");
        toml::from_str::<Plan>(record).unwrap().check().unwrap();
        let refused = |from: &str, to: &str, expected: &str| {
            assert!(Plan::QUICK.contains(from), "{from}");
            let plan: Plan = toml::from_str(&Plan::QUICK.replacen(from, to, 1)).unwrap();
            let error = format!("{:#}", plan.check().unwrap_err());
            assert!(error.contains(expected), "{error}");
        };
        refused("--dropout 0.1", "--dropout 1.5", "row \"reference\"");
        refused("--sensor vlp32c", "", "generic-static");
        refused("seeds = [0]", "seeds = [7, 7]", "seeds");
        refused("batch = 32", "batch = 1", "batch");
        refused("beside = \"seen\"", "beside = \"none\"", "row \"surface\": beside");
    }
}
