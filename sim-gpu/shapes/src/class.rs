//! The classes and which file builds each.

use super::builder::Builder;
use super::sampler::Sampler;
use super::{airplane, bottle, bowl, chair, cone, cup, lamp, monitor, table, vase};

/// Builds one make of a class.
pub(super) type Make = fn(&mut Builder, &mut Sampler);

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
        match self {
            Self::Airplane => airplane::build(b, s),
            Self::Bottle => bottle::build(b, s),
            Self::Bowl => bowl::build(b, s),
            Self::Chair => chair::build(b, s),
            Self::Cone => cone::build(b, s),
            Self::Cup => cup::build(b, s),
            Self::Lamp => lamp::build(b, s),
            Self::Monitor => monitor::build(b, s),
            Self::Table => table::build(b, s),
            Self::Vase => vase::build(b, s),
        }
    }

    /// How often a shape of this class stands turned by a quarter or half
    /// turn against its fellows. Counted on ModelNet40's training clouds:
    /// chairs hardly ever, airplanes and monitors often, vessels anyhow.
    pub(super) fn turn_chance(self) -> f64 {
        match self {
            Self::Chair => 0.02,
            Self::Airplane | Self::Table => 0.15,
            Self::Monitor | Self::Lamp => 0.3,
            Self::Bottle | Self::Bowl | Self::Cone | Self::Cup | Self::Vase => 0.6,
        }
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
