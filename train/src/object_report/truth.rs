//! The right answer to each label of a data set.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use formats::FormatError;
use infer_cpu::UNKNOWN;

use crate::error::Error;

/// Labels of data sets, with the classes of networks for them. Of a model that has a class of the
/// label's name, that class is right.
const ALIASES: [(&str, &str); 6] = [
    ("pedestrian", "person"),
    ("4wd", "car"),
    ("car_4wd", "car"),
    ("pickup", "car"),
    ("ute", "car"),
    ("van", "car"),
];

/// The alias of a label whose objects are left out.
const LEFT_OUT: &str = "";

/// The right answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// This class, an index into the model's.
    Known(usize),
    /// `unknown`.
    Negative,
}

/// The right answer of a model to each label of a data set.
#[derive(Clone, Debug)]
pub struct Labels {
    classes: Vec<String>,
    is_known: Vec<bool>,
    aliases: BTreeMap<String, String>,
}

impl Labels {
    /// For a model with these `classes`. All classes except those in `unknown` are known.
    #[must_use]
    pub fn new(classes: &[String], unknown: &[String]) -> Self {
        let others = ALIASES.iter().filter(|(label, _)| classes.iter().all(|class| class != label));
        Self {
            is_known: classes.iter().map(|class| !unknown.contains(class)).collect(),
            classes: classes.to_vec(),
            aliases: others.map(|&(label, class)| (label.to_owned(), class.to_owned())).collect(),
        }
    }

    /// Adds the aliases in the TOML file at `path`, of labels among those `of_data`, which replace
    /// built-in ones and classes of the same name: `pedestrian = "person"`, or `rider = ""` to leave
    /// objects out.
    pub fn with_aliases(mut self, path: &Path, of_data: &BTreeSet<&str>) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|source| FormatError::io(path, source))?;
        let aliases: BTreeMap<String, String> = toml::from_str(&text)
            .map_err(|error| FormatError::malformed(path, "aliases", error.to_string().trim()))?;
        for (label, class) in &aliases {
            let (expected, among, found) = if !of_data.contains(&**label) {
                (
                    "a label of the data",
                    of_data.iter().copied().collect::<Vec<_>>().join(", "),
                    label,
                )
            } else if class != LEFT_OUT && class != UNKNOWN && self.class(class).is_none() {
                ("unknown, \"\" or a class of the model", self.classes.join(", "), class)
            } else {
                continue;
            };
            let cause = format!("expected {expected} ({among}), found `{found}`");
            return Err(FormatError::malformed(path, label, cause).into());
        }
        self.aliases.extend(aliases);
        Ok(self)
    }

    /// Whether this class of the model is known.
    #[must_use]
    pub fn is_known(&self, class: usize) -> bool {
        self.is_known[class]
    }

    /// The model's classes.
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// The right answer to an object with this `label`: the class of its alias or of that name, or
    /// `unknown` if the model has no such class. `None` if the object is left out.
    #[must_use]
    pub fn truth(&self, label: &str) -> Option<Truth> {
        let name = self.named(label);
        if name == LEFT_OUT {
            return None;
        }
        let class = self.class(name);
        let known = class.filter(|&class| self.is_known[class]);
        Some(known.map_or(Truth::Negative, Truth::Known))
    }

    /// Whether no class of the model is that of this label.
    #[must_use]
    pub fn lacks(&self, label: &str) -> bool {
        self.class(self.named(label)).is_none()
    }

    /// The alias of `label`, or `label` itself.
    fn named<'a>(&'a self, label: &'a str) -> &'a str {
        self.aliases.get(label).map_or(label, String::as_str)
    }

    fn class(&self, name: &str) -> Option<usize> {
        self.classes.iter().position(|class| class == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_its_class_or_its_alias_or_a_negative() {
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        let labels = Labels::new(&names(&["car", "person", "tree"]), &names(&["tree"]));
        assert_eq!(labels.truth("car"), Some(Truth::Known(0)));
        assert_eq!(labels.truth("pedestrian"), Some(Truth::Known(1)));
        assert_eq!(labels.truth("van"), Some(Truth::Known(0)));
        assert_eq!(labels.truth("tree"), Some(Truth::Negative));
        assert_eq!(labels.truth("bush"), Some(Truth::Negative));
        assert!(labels.lacks("bush") && !labels.lacks("tree") && !labels.lacks("van"));
        let with_vans = Labels::new(&names(&["car", "van"]), &[]);
        assert_eq!(with_vans.truth("van"), Some(Truth::Known(1)));

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("aliases.toml");
        let of_data = BTreeSet::from(["car", "cyclist", "van"]);
        let with = |text: &str| {
            std::fs::write(&path, text).unwrap();
            labels.clone().with_aliases(&path, &of_data)
        };
        let changed = with("cyclist = \"person\"\nvan = \"\"\ncar = \"person\"\n").unwrap();
        assert_eq!(changed.truth("cyclist"), Some(Truth::Known(1)));
        assert_eq!(changed.truth("van"), None);
        assert_eq!(changed.truth("car"), Some(Truth::Known(1)));
        assert_eq!(with("car = \"unknown\"").unwrap().truth("car"), Some(Truth::Negative));
        for (text, cause) in [
            ("van = 3", "aliases: "),
            ("vam = \"car\"", "vam: expected a label of the data (car, cyclist, van), found `vam`"),
            (
                "van = \"cra\"",
                "van: expected unknown, \"\" or a class of the model (car, person, tr",
            ),
        ] {
            let error = with(text).unwrap_err().to_string();
            assert!(error.contains(&format!("aliases.toml: {cause}")), "{error}");
        }
    }
}
