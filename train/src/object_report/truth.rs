//! What the answer to a label of data should be.

use std::collections::BTreeMap;
use std::path::Path;

use formats::FormatError;

use crate::error::Error;

/// What labelled sets call the things that networks call otherwise. A label that the
/// model has a class for is never replaced.
const ALIASES: [(&str, &str); 6] = [
    ("pedestrian", "person"),
    ("4wd", "car"),
    ("car_4wd", "car"),
    ("pickup", "car"),
    ("ute", "car"),
    ("van", "car"),
];

/// Stands in a file of aliases for a label whose objects are left out.
const LEFT_OUT: &str = "";

/// What the answer should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// This class of the model.
    Known(usize),
    /// `unknown`.
    Negative,
}

/// What each label of data means to a model.
#[derive(Clone, Debug)]
pub struct Labels {
    classes: Vec<String>,
    is_known: Vec<bool>,
    aliases: BTreeMap<String, String>,
}

impl Labels {
    /// For a model of these `classes`, of which all but `unknown` are known.
    #[must_use]
    pub fn new(classes: &[String], unknown: &[String]) -> Self {
        let aliases = ALIASES.map(|(label, class)| (label.to_owned(), class.to_owned()));
        Self {
            is_known: classes.iter().map(|class| !unknown.contains(class)).collect(),
            classes: classes.to_vec(),
            aliases: aliases.into(),
        }
    }

    /// The same with the aliases of the TOML file at `path` before the built-in ones:
    /// `pedestrian = "person"`, or `rider = ""` for objects that are left out.
    ///
    /// # Errors
    /// A file that is not such a table.
    pub fn with_aliases(mut self, path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|source| FormatError::io(path, source))?;
        let aliases: BTreeMap<String, String> = toml::from_str(&text)
            .map_err(|error| FormatError::malformed(path, "aliases", error.to_string().trim()))?;
        self.aliases.extend(aliases);
        Ok(self)
    }

    /// Whether the model is to tell this class, one of its own, from others.
    #[must_use]
    pub fn is_known(&self, class: usize) -> bool {
        self.is_known[class]
    }

    /// The model's classes.
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// What the answer to an object of `label` should be: its class, or that of its
    /// alias, or `unknown` if the model has neither; `None` if it is left out.
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

    /// Whether the model has neither this label nor its alias as a class, known or
    /// not.
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
