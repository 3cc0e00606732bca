//! The classes and which file builds each.

use std::fmt;

use crate::primitives::{Builder, Sampler};
use crate::{airplane, bottle, bowl, chair, cone, cup, lamp, monitor, table, vase};

/// The class names in the order of their labels: ModelNet40's, alphabetical.
pub const CLASSES: [&str; 10] =
    ["airplane", "bottle", "bowl", "chair", "cone", "cup", "lamp", "monitor", "table", "vase"];

/// Builds one make of a class.
pub(super) type Make = fn(&mut Builder, &mut Sampler);

/// What builds each class, and how often a shape of it stands turned by a quarter
/// or half turn against its fellows. Counted on ModelNet40's training clouds:
/// chairs hardly ever, airplanes and monitors often, vessels anyhow.
const FAMILIES: [(Make, f64); 10] = [
    (airplane::build, 0.15),
    (bottle::build, 0.6),
    (bowl::build, 0.6),
    (chair::build, 0.02),
    (cone::build, 0.6),
    (cup::build, 0.6),
    (lamp::build, 0.3),
    (monitor::build, 0.3),
    (table::build, 0.15),
    (vase::build, 0.6),
];

/// One of the ten shape families.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ShapeClass {
    /// Airliners, light aircraft, biplanes, jets, gliders, flying wings.
    Airplane,
    /// Wine and beer bottles, flasks, jars, jugs, dispensers.
    Bottle,
    /// Round, oval, square and scalloped bowls.
    Bowl,
    /// Chairs on legs, stars, discs, sledges and cantilevers; armchairs.
    Chair,
    /// Cones, frusta, traffic cones, party hats, ice-cream cones.
    Cone,
    /// Mugs, tea cups, tumblers, goblets, steins.
    Cup,
    /// Table, floor, desk, tripod, arc and pendant lamps.
    Lamp,
    /// Flat panels on several stands, tubes, pairs, televisions.
    Monitor,
    /// Tables on legs, pedestals, trestles, panels; desks with drawers.
    Table,
    /// Amphorae, trumpets, globes, cylinders, square and fluted vases.
    Vase,
}

impl ShapeClass {
    /// All classes in the order of their labels.
    pub const ALL: [Self; 10] = {
        use ShapeClass::{Airplane, Bottle, Bowl, Chair, Cone, Cup, Lamp, Monitor, Table, Vase};
        [Airplane, Bottle, Bowl, Chair, Cone, Cup, Lamp, Monitor, Table, Vase]
    };

    /// The class's name, as in [`CLASSES`].
    #[must_use]
    pub fn name(self) -> &'static str {
        CLASSES[self as usize]
    }

    /// The class of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|class| class.name() == name)
    }

    /// Builds the shape that `s` draws, in the class's own frame.
    pub(super) fn build(self, b: &mut Builder, s: &mut Sampler) {
        FAMILIES[self as usize].0(b, s);
    }

    /// How often a shape of this class stands turned.
    pub(super) fn turn_chance(self) -> f64 {
        FAMILIES[self as usize].1
    }
}

impl fmt::Display for ShapeClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_labels_agree() {
        for (label, class) in ShapeClass::ALL.into_iter().enumerate() {
            assert_eq!(class as usize, label);
            assert_eq!(ShapeClass::from_name(CLASSES[label]), Some(class));
        }
        assert_eq!(ShapeClass::from_name("sofa"), None);
        assert!(CLASSES.is_sorted());
    }
}
