//! The right answer to each label of a data set.

use std::collections::BTreeMap;
use std::path::Path;

use formats::FormatError;

use crate::error::Error;

/// Labels of data sets, with the classes of networks for them. A label that is a class of the model
/// is not replaced.
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
        let aliases = ALIASES.map(|(label, class)| (label.to_owned(), class.to_owned()));
        Self {
            is_known: classes.iter().map(|class| !unknown.contains(class)).collect(),
            classes: classes.to_vec(),
            aliases: aliases.into(),
        }
    }

    /// Adds the aliases in the TOML file at `path`, which replace built-in ones: `pedestrian =
    /// "person"`, or `rider = ""` to leave objects out.
    pub fn with_aliases(mut self, path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|source| FormatError::io(path, source))?;
        let aliases: BTreeMap<String, String> = toml::from_str(&text)
            .map_err(|error| FormatError::malformed(path, "aliases", error.to_string().trim()))?;
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

    /// The right answer to an object with this `label`: the class of that name, the class of its
    /// alias, or `unknown` if the model has neither. `None` if the object is left out.
    #[must_use]
    pub fn truth(&self, label: &str) -> Option<Truth> {
        let alias = self.aliases.get(label).map(String::as_str);
        if alias == Some(LEFT_OUT) {
            return None;
        }
        let class = self.class(label).or_else(|| self.class(alias?));
        let known = class.filter(|&class| self.is_known[class]);
        Some(known.map_or(Truth::Negative, Truth::Known))
    }

    /// Whether neither this label nor its alias is a class of the model.
    #[must_use]
    pub fn lacks(&self, label: &str) -> bool {
        let alias = self.aliases.get(label);
        self.class(label).or_else(|| self.class(alias?)).is_none()
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
        std::fs::write(&path, "cyclist = \"person\"\nvan = \"\"\n").unwrap();
        let labels = labels.with_aliases(&path).unwrap();
        assert_eq!(labels.truth("cyclist"), Some(Truth::Known(1)));
        assert_eq!(labels.truth("van"), None);
        std::fs::write(&path, "van = 3").unwrap();
        let error = labels.with_aliases(&path).unwrap_err().to_string();
        assert!(error.contains("aliases.toml: aliases: "), "{error}");
    }
}
