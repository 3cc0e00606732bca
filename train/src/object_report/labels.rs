//! The right answer to each label of a data set.

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

/// The right answer of a model to each label of a data set.
#[derive(Clone, Debug)]
pub struct Labels {
    /// The model's classes.
    pub classes: Vec<String>,
    /// Whether each class is known; the model answers the others as `unknown`.
    pub is_known: Vec<bool>,
}

impl Labels {
    /// For a model with these `classes`. All classes except those in `unknown` are known.
    pub fn new(classes: &[String], unknown: &[String]) -> Self {
        let is_known = classes.iter().map(|class| !unknown.contains(class)).collect();
        Self { classes: classes.to_vec(), is_known }
    }

    /// The right answer to an object with this `label`: the known class of that name or of its
    /// alias. `None`, which is `unknown`, if the model has no such class.
    pub fn truth(&self, label: &str) -> Option<usize> {
        self.class(label).filter(|&class| self.is_known[class])
    }

    /// The class of this label or of its alias, known or not.
    pub fn class(&self, label: &str) -> Option<usize> {
        let position = |name: &str| self.classes.iter().position(|class| class == name);
        let alias = || ALIASES.iter().find(|(alias, _)| *alias == label);
        position(label).or_else(|| position(alias()?.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_its_class_or_its_alias_or_a_negative() {
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        let labels = Labels::new(&names(&["car", "person", "tree"]), &names(&["tree"]));
        for (label, truth, class) in [
            ("car", Some(0), Some(0)),
            ("pedestrian", Some(1), Some(1)),
            ("van", Some(0), Some(0)),
            ("tree", None, Some(2)),
            ("bush", None, None),
        ] {
            assert_eq!((labels.truth(label), labels.class(label)), (truth, class), "{label}");
        }
        let with_vans = Labels::new(&names(&["car", "van"]), &[]);
        assert_eq!(with_vans.truth("van"), Some(1));
    }
}
