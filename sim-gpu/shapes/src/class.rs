//! The classes and which file builds each.

use crate::primitives::{Builder, Make, Sampler};
use crate::{airplane, bottle, bowl, chair, cone, cup, lamp, monitor, table, vase};

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

formats::named! {
    /// One of the ten shape families, in the order of their labels. Their names are
    /// ModelNet40's.
    pub enum ShapeClass: "class of shapes" {
        /// Airliners, light aircraft, biplanes, jets, gliders, flying wings.
        Airplane = "airplane",
        /// Wine and beer bottles, flasks, jars, jugs, dispensers.
        Bottle = "bottle",
        /// Round, oval, square and scalloped bowls.
        Bowl = "bowl",
        /// Chairs on legs, stars, discs, sledges and cantilevers; armchairs.
        Chair = "chair",
        /// Cones, frusta, traffic cones, party hats, ice-cream cones.
        Cone = "cone",
        /// Mugs, tea cups, tumblers, goblets, steins.
        Cup = "cup",
        /// Table, floor, desk, tripod, arc and pendant lamps.
        Lamp = "lamp",
        /// Flat panels on several stands, tubes, pairs, televisions.
        Monitor = "monitor",
        /// Tables on legs, pedestals, trestles, panels; desks with drawers.
        Table = "table",
        /// Amphorae, trumpets, globes, cylinders, square and fluted vases.
        Vase = "vase",
    }
}

impl ShapeClass {
    /// Builds the shape that `s` draws, in the class's own frame.
    pub(super) fn build(self, b: &mut Builder, s: &mut Sampler) {
        FAMILIES[self as usize].0(b, s);
    }

    /// How often a shape of this class stands turned.
    pub(super) fn turn_chance(self) -> f64 {
        FAMILIES[self as usize].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readers of folders sort the classes, and a label is a place among them.
    #[test]
    fn labels_follow_the_order_of_names() {
        assert!(ShapeClass::ALL.map(ShapeClass::name).is_sorted());
    }
}
