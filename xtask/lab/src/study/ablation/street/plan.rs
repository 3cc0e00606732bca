//! Which street scenes are compared: a base, and in each row what it changes.

use super::REAL;
use crate::study::plan;
use anyhow::{Context, ensure};
use edgepuck_scenes::Recipe as Scenes;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use toml::{Table, Value};
use train::recipe::Recipe;

/// The street and the recipe of its network, which rows change.
pub(super) const STREET: &str = include_str!("../../../../../../assets/scenes/street.toml");
pub(super) const NETWORK: &str = include_str!("../../../../../../assets/recipes/street-128.toml");

/// The study's sizes and rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// A remark on the results.
    pub about: String,
    /// Scenes of each row and seed; each tenth is for testing.
    pub scenes: u32,
    /// For each of these, scenes are drawn and a network is trained.
    pub seeds: Vec<u64>,
    /// Points that an object must have to be tested on.
    pub min_points: usize,
    /// The classes that matter; to all others the right answer is neither.
    pub known: Vec<String>,
    /// Rounds in which the time of each row's scenes is measured, and scenes of each.
    pub cost_rounds: usize,
    pub cost_scenes: u32,
    /// What every row changes of the network's recipe.
    #[serde(default)]
    pub recipe: Table,
    /// The rows; the first is what the others are compared with.
    pub row: Vec<Row>,
}

/// Scenes and a network, by what they change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Row {
    /// What the row is called.
    pub name: String,
    /// In place of what the scene recipe says at its top.
    pub scene: Table,
    /// In place of what it says of each sensor.
    pub sensor: Table,
    /// In place of what it says of each kind of objects.
    pub object: Table,
    /// The same of the kinds of one class, after `object`.
    pub class: BTreeMap<String, Table>,
    /// The classes whose objects are left; all if empty.
    pub only: Vec<String>,
    /// Sensors in place of the recipe's.
    pub sensors: Vec<String>,
    /// In place of what the network's recipe says.
    pub recipe: Table,
}

impl plan::Plan for Plan {
    const FULL: &'static str = include_str!("../../../../../../assets/ablations/street.toml");
    const QUICK: &'static str =
        include_str!("../../../../../../assets/ablations/street-quick.toml");

    fn check(&self) -> anyhow::Result<()> {
        ensure!(self.scenes >= 20, "scenes: expected 20 or more, found {}", self.scenes);
        ensure!(!self.seeds.is_empty(), "seeds: expected at least one, found none");
        let distinct: BTreeSet<&u64> = self.seeds.iter().collect();
        ensure!(distinct.len() == self.seeds.len(), "seeds: expected different ones");
        ensure!(self.cost_rounds > 0, "cost_rounds: expected 1 or more, found 0");
        ensure!(self.cost_scenes > 0, "cost_scenes: expected 1 or more, found 0");
        ensure!(!self.row.is_empty(), "row: expected at least one, found none");
        let known: BTreeSet<&String> = self.known.iter().collect();
        ensure!(
            !known.is_empty() && known.len() == self.known.len(),
            "known: expected classes, each once, found {:?}",
            self.known
        );
        let mut folders = BTreeSet::new();
        for row in &self.row {
            let name = &row.name;
            ensure!(!row.folder().is_empty(), "row: expected a name of letters, found \"{name}\"");
            let is_free = name != REAL && folders.insert(row.folder());
            ensure!(is_free, "row \"{name}\": expected another name");
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
    pub fn recipe_of(&self, row: &Row, seed: u64) -> anyhow::Result<Recipe> {
        let mut recipe: Table = toml::from_str(NETWORK)?;
        change(&mut recipe, &self.recipe);
        change(&mut recipe, &row.recipe);
        let recipe = Recipe { seed, ..recipe.try_into().context("recipe")? };
        recipe.check().context("recipe")?;
        Ok(recipe)
    }
}

impl Row {
    /// The scenes of this row.
    pub fn scenes(&self) -> anyhow::Result<Scenes> {
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

    /// Its folder's name.
    pub fn folder(&self) -> String {
        let words = self.name.split(|c: char| !c.is_ascii_alphanumeric());
        words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-").to_lowercase()
    }
}

/// Puts `by` in place of what `table` says, table by table.
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
        let parts = include_str!("../../../../../../assets/ablations/street-parts.toml");
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
        assert_eq!(row.folder(), "rain-25-mm-h");
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
