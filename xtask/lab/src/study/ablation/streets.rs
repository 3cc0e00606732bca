//! `cargo xtask ablate streets`: scenes of a street with the changes of each row, tested on simulated
//! and on real objects.

use super::{Network, Score, Study, StudyArgs, check_rows, folder_name, measure};
use crate::measure::clock::{Workload, workload};
use crate::study::{plan, resume};
use anyhow::{Context, ensure};
use edgepuck_program::Outcome;
use edgepuck_scenes::{DrawnScene, Recipe as Scenes, SceneError, Stage, generate};
use edgepuck_segment::Settings;
use formats::hash;
use formats::split::Split;
use infer_cpu::Options;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use toml::{Table, Value};
use train::clouds::Clouds;
use train::object_report::{Labels, Object, Truth, classified, detection};
use train::recipe::Recipe;
use train::run::MOST_POINTS;

#[derive(clap::Args)]
pub struct StreetsArgs {
    /// Labelled clusters of real scans to test on, in NPZ files as `eval --data` takes them; repeat
    /// the flag
    #[arg(long, value_name = "NPZ")]
    real: Vec<PathBuf>,

    #[command(flatten)]
    study: StudyArgs,
}

/// The street and the recipe of its network, which rows change.
const STREET: &str = include_str!("../../../../../assets/scenes/street.toml");
const NETWORK: &str = include_str!("../../../../../assets/recipes/street-128.toml");

/// The class of objects that should be answered as `unknown`.
const NEGATIVES: &str = "negatives";

/// The name of the real objects as a set to test on.
const REAL: &str = "real objects";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Plan {
    about: String,
    /// Scenes of each row and seed; each tenth is for testing.
    scenes: u32,
    /// For each of these, scenes are drawn and a network is trained.
    seeds: Vec<u64>,
    /// Points that an object must have to be tested on.
    min_points: usize,
    /// The known classes; the right answer to all others is `unknown`.
    known: Vec<String>,
    /// Rounds in which the time of each row's scenes is measured, and scenes of each.
    cost_rounds: usize,
    cost_scenes: u32,
    /// Changes of the network's recipe in all rows.
    #[serde(default)]
    recipe: Table,
    /// The rows; the first is what the others are compared with.
    row: Vec<Row>,
}

/// Scenes and a network, by what they change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Row {
    name: String,
    /// Replaces keys at the top of the scene recipe.
    scene: Table,
    /// Replaces keys of each sensor.
    sensor: Table,
    /// Replaces keys of each kind of objects.
    object: Table,
    /// Replaces keys of the kinds of one class, after `object`.
    class: BTreeMap<String, Table>,
    /// The classes whose objects are left; all if empty.
    only: Vec<String>,
    /// Sensors in place of the recipe's.
    sensors: Vec<String>,
    /// Replaces keys of the network's recipe.
    recipe: Table,
}

impl plan::Plan for Plan {
    const FULL: &'static str = include_str!("../../../../../assets/ablations/street.toml");
    const QUICK: &'static str = include_str!("../../../../../assets/ablations/street-quick.toml");

    fn check(&self) -> anyhow::Result<()> {
        ensure!(self.scenes >= 20, "scenes: expected 20 or more, found {}", self.scenes);
        let names = self.row.iter().map(|row| row.name.as_str());
        check_rows(&self.seeds, self.cost_rounds, names, Some(REAL))?;
        ensure!(self.cost_scenes > 0, "cost_scenes: expected 1 or more, found 0");
        let known: BTreeSet<&String> = self.known.iter().collect();
        ensure!(
            !known.is_empty() && known.len() == self.known.len(),
            "known: expected classes, each once, found {:?}",
            self.known
        );
        for row in &self.row {
            let name = &row.name;
            let scenes = row.scenes().with_context(|| format!("row \"{name}\""))?;
            let recipe = self.recipe_of(row, 0).with_context(|| format!("row \"{name}\""))?;
            let classes = scenes.classes();
            for class in self.known.iter().chain(&recipe.unknown) {
                ensure!(classes.contains(class), "row \"{name}\": no objects of class {class}");
            }
        }
        Ok(())
    }
}

impl Plan {
    /// How the network of `row` is trained.
    fn recipe_of(&self, row: &Row, seed: u64) -> anyhow::Result<Recipe> {
        let mut recipe: Table = toml::from_str(NETWORK)?;
        change(&mut recipe, &self.recipe);
        change(&mut recipe, &row.recipe);
        let recipe = Recipe { seed, ..recipe.try_into().context("recipe")? };
        recipe.check().context("recipe")?;
        Ok(recipe)
    }
}

impl Row {
    fn scenes(&self) -> anyhow::Result<Scenes> {
        let mut scenes: Table = toml::from_str(STREET)?;
        change(&mut scenes, &self.scene);
        each(&mut scenes, "sensor", |sensor| change(sensor, &self.sensor));
        each(&mut scenes, "object", |object| {
            change(object, &self.object);
            let class = object.get("class").and_then(Value::as_str).unwrap_or_default();
            if let Some(own) = self.class.get(class) {
                change(object, own);
            }
        });
        if !self.only.is_empty()
            && let Some(Value::Array(objects)) = scenes.get_mut("object")
        {
            let class = |object: &Value| Some(object.get("class")?.as_str()?.to_owned());
            objects.retain(|object| class(object).is_some_and(|class| self.only.contains(&class)));
        }
        let text = toml::to_string(&scenes)?;
        let mut scenes = Scenes::parse(&text, "street.toml".as_ref())?;
        scenes.use_sensors(&self.sensors);
        Ok(scenes)
    }
}

struct Streets<'a> {
    plan: Plan,
    args: &'a StreetsArgs,
    out: PathBuf,
}

pub fn run(args: &StreetsArgs) -> anyhow::Result<Outcome> {
    let plan: Plan = args.study.plan()?;
    let study = Streets { plan, args, out: args.study.out.join("street") };
    study.keep_terms()?;
    measure(&study, &study.out)?;
    Ok(Outcome::Success)
}

impl Streets<'_> {
    /// Writes the plan and hashes of the real objects, or compares them with an earlier run's.
    fn keep_terms(&self) -> anyhow::Result<()> {
        #[derive(Serialize)]
        struct Terms<'a> {
            version: &'a str,
            real: Vec<String>,
            street: String,
            network: String,
            plan: &'a Plan,
        }
        let real = self.args.real.iter().map(|path| hash::of_file(path));
        let real = real.collect::<Result<_, _>>()?;
        let [street, network] = [STREET, NETWORK].map(|text| hash::of_bytes(text.as_bytes()));
        let (version, plan) = (env!("CARGO_PKG_VERSION"), &self.plan);
        let text = toml::to_string(&Terms { version, real, street, network, plan })?;
        resume::keep_terms(&text, &self.out.join("terms.toml"))
    }

    /// The folder of the clusters of `row`, made if they are not there. Rows of the same scenes
    /// share them.
    fn scenes(&self, row: &Row, seed: u64) -> anyhow::Result<PathBuf> {
        let recipe = row.scenes()?;
        let of = |other: &&Row| other.scenes().is_ok_and(|scenes| scenes == recipe);
        let first = self.plan.row.iter().find(of).unwrap_or(row);
        let folder = self.out.join(format!("scenes/{}-{seed}", folder_name(&first.name)));
        if !folder.join("test.npz").is_file() {
            eprintln!("scenes of \"{}\", seed {seed}", first.name);
            let each = |_: &_| Ok::<_, SceneError>(());
            let stage = stage(first, seed)?;
            generate(&stage, &Settings::default(), self.plan.scenes, &folder, each)?;
        }
        Ok(folder)
    }
}

impl Study for Streets<'_> {
    const NAME: &'static str = "street";

    fn seeds(&self) -> &[u64] {
        &self.plan.seeds
    }

    fn rows(&self) -> Vec<&str> {
        self.plan.row.iter().map(|row| row.name.as_str()).collect()
    }

    fn goal(&self) -> &str {
        REAL
    }

    fn lesson(&self, row: usize, seed: u64) -> anyhow::Result<(Recipe, Clouds)> {
        let row = &self.plan.row[row];
        let recipe = self.plan.recipe_of(row, seed)?;
        let scenes = self.scenes(row, seed)?.join("train.npz");
        let clouds = Clouds::read_for(recipe.normalization, &scenes, Split::Train, MOST_POINTS)?;
        Ok((recipe, clouds))
    }

    fn scores(
        &self,
        network: &Network<'_>,
        tested_on: &str,
        seed: u64,
    ) -> anyhow::Result<Vec<Score>> {
        let row = self.plan.row.iter().find(|row| row.name == tested_on);
        let files = match row {
            Some(row) => vec![self.scenes(row, seed)?.join("test.npz")],
            None => self.args.real.clone(),
        };
        let is_known = |class: &&String| self.plan.known.contains(class);
        let unknown: Vec<String> =
            network.classes.iter().filter(|class| !is_known(class)).cloned().collect();
        let labels = Labels::new(network.classes, &unknown);
        let (normalization, mut objects) = (network.recipe.normalization, Vec::new());
        for path in files {
            let clouds = Clouds::read_for(normalization, &path, Split::Test, MOST_POINTS)?;
            let wanted = (&labels, self.plan.min_points);
            objects.extend(classified(&network.path, "", &clouds, wanted, &Options::default())?);
        }
        let margins = |is_known: bool| -> Vec<f64> {
            let some = objects.iter().filter(|o| (o.truth != Truth::Negative) == is_known);
            some.filter_map(|object| object.answer.margin).collect()
        };
        let auroc = detection(&margins(true), &margins(false)).map(|found| found.auroc);
        let class_of = |object: &&Object| match object.truth {
            Truth::Known(class) => labels.classes()[class].as_str(),
            Truth::Negative => NEGATIVES,
        };
        let classes = self.plan.known.iter().map(String::as_str).chain([NEGATIVES]);
        let score = |class: &str| {
            let of = || objects.iter().filter(|object| class_of(object) == class);
            let right = of().filter(|object| object.is_right()).count();
            Score { class: class.to_owned(), right, of: of().count(), auroc }
        };
        Ok(classes.map(score).collect())
    }

    fn cost_rounds(&self) -> usize {
        self.plan.cost_rounds
    }

    fn scanning(&self, row: usize, seed: u64) -> anyhow::Result<(Workload<'_>, usize)> {
        let (stage, n) = (stage(&self.plan.row[row], seed)?, self.plan.cost_scenes);
        let scenes: Vec<DrawnScene> =
            (0..n).map(|number| DrawnScene::draw(&stage, number)).collect();
        let scan =
            move || Ok(scenes.iter().try_for_each(|scene| stage.sweep(scene).map(|_| ()))?);
        Ok((workload(scan), n as usize))
    }
}

fn stage(row: &Row, seed: u64) -> anyhow::Result<Stage> {
    Ok(Stage::new(row.scenes()?, "street.toml".as_ref(), None, seed)?)
}

/// Replaces the values of `table` by those of `by`, table by table.
fn change(table: &mut Table, by: &Table) {
    for (key, value) in by {
        match (table.get_mut(key), value) {
            (Some(Value::Table(old)), Value::Table(new)) => change(old, new),
            _ => {
                table.insert(key.clone(), value.clone());
            }
        }
    }
}

/// Lets `edit` change each table of the array `key`.
fn each(table: &mut Table, key: &str, edit: impl Fn(&mut Table)) {
    let items = table.get_mut(key).and_then(Value::as_array_mut);
    items.into_iter().flatten().filter_map(Value::as_table_mut).for_each(edit);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::plan::Plan as _;

    #[test]
    fn every_plan_that_ships_is_valid() {
        let parts = include_str!("../../../../../assets/ablations/street-parts.toml");
        for text in [Plan::FULL, Plan::QUICK, parts] {
            let plan: Plan = toml::from_str(text).unwrap();
            plan.check().unwrap();
            // The first row is the street as it ships.
            let street = Scenes::parse(STREET, "street.toml".as_ref()).unwrap();
            assert_eq!(plan.row[0].scenes().unwrap(), street);
        }
    }

    #[test]
    fn a_row_changes_what_it_names_and_nothing_else() {
        let row: Row = toml::from_str(
            r#"name = "Rain, 25 mm/h"
            sensor.effects = { weather = { rain_mm_h = 25 } }
            object.reflectivity = [0.1, 0.6]
            class.car.reflectivity = [0.04, 0.8]
            only = ["car", "person"]
            sensors = ["hdl64e"]"#,
        )
        .unwrap();
        assert_eq!(folder_name(&row.name), "rain-25-mm-h");
        let (found, street) = (row.scenes().unwrap(), Row::default().scenes().unwrap());
        assert_eq!((found.ground.clone(), found.classes().len()), (street.ground.clone(), 3));
        assert_eq!(found.sensor.len(), 1);
        assert_eq!(found.sensor[0].noise_m, street.sensor[0].noise_m);
        assert!(found.sensor[0].effects.weather.is_some());
        for objects in &found.object {
            let expected = if objects.class == "car" { 0.04 } else { 0.1 };
            assert_eq!(objects.reflectivity.least, expected, "{}", objects.class);
        }
    }

    #[test]
    fn a_row_that_makes_no_scenes_is_named() {
        let refused = |row: &str, expected: &str| {
            let text = Plan::QUICK.to_owned() + "\n[[row]]\nname = \"odd\"\n" + row;
            let plan: Plan = toml::from_str(&text).unwrap();
            let error = format!("{:#}", plan.check().unwrap_err());
            assert!(error.contains("\"odd\"") && error.contains(expected), "{error}");
        };
        refused("sensor.nois_m = 0", "nois_m");
        refused("object.count = [3, 2]", "object[0].count");
        refused("recipe = { points = 0 }", "points");
        refused("only = [\"car\"]", "no objects of class person");
    }
}
