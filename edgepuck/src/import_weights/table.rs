//! Importer tables: the names of a PointNet's layers in another repository, and the facts that its
//! checkpoints do not state.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use formats::model_card::ModelCard;
use serde::Deserialize;

/// The built-in tables in the order of trial.
const BUILTIN: [(&str, &str); 2] = edgepuck_assets::IMPORTERS;

/// PyTorch's names of the tensors of a layer that a model needs.
const PARTS: [&str; 4] = ["weight", "bias", "running_mean", "running_var"];

/// The tensor of a batch norm that counts training steps.
const COUNTER: &str = "num_batches_tracked";

/// Stands for any number in a layer's name.
const NUMBER: &str = "{i}";

/// Largest number of unknown names in an error.
const LISTED: usize = 5;

#[derive(Debug)]
pub struct Table {
    /// A short name of the repository.
    pub name: String,
    /// The card of a model, without classes, accuracy and provenance.
    pub card: ModelCard,
    /// The class names of a model with this number of logits.
    pub default_classes: Vec<String>,
    /// Maps their layers to ours. Both names may hold one [`NUMBER`].
    layers: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TableFile {
    name: String,
    #[serde(default)]
    default_classes: Vec<String>,
    layers: BTreeMap<String, String>,
    #[serde(default)]
    card: BTreeMap<String, toml::Value>,
}

/// Maps our names of a model's tensors to theirs.
pub type Names = BTreeMap<String, String>;

impl Table {
    pub fn builtin() -> anyhow::Result<Vec<Self>> {
        BUILTIN.into_iter().map(|(path, text)| Self::parse(Path::new(path), text)).collect()
    }

    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))?;
        Self::parse(path, &text)
    }

    fn parse(path: &Path, text: &str) -> anyhow::Result<Self> {
        let here = || format!("{}", path.display());
        let TableFile { name, default_classes, layers, card } =
            toml::from_str(text).with_context(here)?;
        for (theirs, ours) in &layers {
            check_numbers(theirs, ours).with_context(here)?;
        }
        let card = parse_card(path, &card)?;
        Ok(Self { name, card, default_classes, layers })
    }

    /// Our names of the tensors `keys`, and the keys that are unknown to the table.
    fn names<'k>(
        &self,
        keys: impl Iterator<Item = &'k str>,
    ) -> anyhow::Result<(Names, Vec<&'k str>)> {
        let mut names = Names::new();
        let mut unknown = Vec::new();
        for key in keys {
            let (layer, part) = key.rsplit_once('.').unwrap_or((key, ""));
            let Some(ours) = self.rename(layer) else {
                unknown.push(key);
                continue;
            };
            if PARTS.contains(&part) {
                let ours = format!("{ours}.{part}");
                if let Some(other) = names.insert(ours.clone(), key.to_owned()) {
                    bail!("table `{}` makes both `{other}` and `{key}` `{ours}`", self.name);
                }
            } else if part != COUNTER {
                unknown.push(key);
            }
        }
        Ok((names, unknown))
    }

    fn rename(&self, layer: &str) -> Option<String> {
        self.layers.iter().find_map(|(theirs, ours)| match theirs.split_once(NUMBER) {
            None => (theirs == layer).then(|| ours.clone()),
            Some((before, after)) => {
                let number = layer.strip_prefix(before)?.strip_suffix(after)?;
                let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
                is_number.then(|| ours.replace(NUMBER, number))
            }
        })
    }
}

/// The first of `tables` that knows all tensors in `keys`, and its names for them.
pub fn choose<'t, 'k>(
    tables: &'t [Table],
    keys: impl Iterator<Item = &'k str> + Clone,
) -> anyhow::Result<(&'t Table, Names)> {
    let mut nearest: Option<(&Table, Vec<&str>)> = None;
    for table in tables {
        let (names, unknown) = table.names(keys.clone())?;
        if unknown.is_empty() {
            return Ok((table, names));
        }
        if nearest.as_ref().is_none_or(|(_, fewest)| unknown.len() < fewest.len()) {
            nearest = Some((table, unknown));
        }
    }
    let Some((table, unknown)) = nearest else { bail!("expected an importer table, found none") };
    let listed = unknown.iter().take(LISTED).map(|key| format!("`{key}`"));
    let listed = listed.collect::<Vec<_>>().join(", ");
    let more = match unknown.len().saturating_sub(LISTED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    bail!(
        "no importer table knows all of its tensors; the nearest, `{}`, does not know {listed}{more}. \
         Write a table like assets/importers/3dcertify.toml, with a line for each layer, and name it \
         by --table",
        table.name
    )
}

fn check_numbers(theirs: &str, ours: &str) -> anyhow::Result<()> {
    let count = |name: &str| name.matches(NUMBER).count();
    if count(theirs) > 1 || count(theirs) != count(ours) {
        bail!("layers: \"{theirs}\" = \"{ours}\": {NUMBER} may stand once, and then on both sides");
    }
    Ok(())
}

/// Parses a card from keys and values as in the metadata of a model file.
fn parse_card(path: &Path, entries: &BTreeMap<String, toml::Value>) -> anyhow::Result<ModelCard> {
    let text =
        |value: &toml::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let metadata = entries.iter().map(|(key, value)| (key.clone(), text(value))).collect();
    let card = ModelCard::from_metadata(path, &metadata)?;
    let known = card.to_metadata();
    match entries.keys().find(|key| !known.contains_key(*key)) {
        Some(key) => bail!("{}: card: unknown key `{key}`", path.display()),
        None => Ok(card),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(keys: &[&str]) -> Result<(String, Names), String> {
        let tables = Table::builtin().unwrap();
        let (table, names) = choose(&tables, keys.iter().copied()).map_err(|e| e.to_string())?;
        Ok((table.name.clone(), names))
    }

    #[test]
    fn the_table_that_knows_every_name_is_chosen() {
        let (table, names) = chosen(&["feat.fstn.bn5.bias", "fc12.weight"]).unwrap();
        assert_eq!(table, "yanx27");
        assert_eq!(names["fc12.weight"], "fc12.weight");
        let (table, names) = chosen(&["mlp2.4.running_var", "mlp2.4.num_batches_tracked"]).unwrap();
        assert_eq!(table, "3dcertify");
        assert_eq!(
            names,
            Names::from([("feat.bn4.running_var".into(), "mlp2.4.running_var".into())])
        );
    }

    #[test]
    fn unknown_names_are_counted_and_the_first_are_listed() {
        let keys = ["fc1.bias", "x0", "fc.bias", "fc1", "fc-1.bias", "bn1.scale", "mlp1.0.bias"];
        let error = chosen(&keys).unwrap_err();
        let listed = "the nearest, `yanx27`, does not know `x0`, `fc.bias`, `fc1`, `fc-1.bias`, \
                      `bn1.scale` and 1 more. ";
        assert!(error.contains(listed), "{error}");
    }

    #[test]
    fn two_tensors_of_one_name_are_an_error() {
        let text = "name = \"t\"\n[layers]\n\"a{i}\" = \"fc{i}\"\n\"b\" = \"fc1\"\n";
        let table = Table::parse(Path::new("t.toml"), text).unwrap();
        let error = choose(&[table], ["a1.bias", "b.bias"].into_iter()).unwrap_err().to_string();
        assert_eq!(error, "table `t` makes both `a1.bias` and `b.bias` `fc1.bias`");
    }

    #[test]
    fn default_classes_are_those_of_the_data_sets_labels() {
        let path = test_support::need!(test_support::shared_data("points/classes.txt"));
        let text = std::fs::read_to_string(path).unwrap();
        for table in Table::builtin().unwrap() {
            assert!(text.lines().eq(&table.default_classes), "{}", table.name);
        }
    }
}
