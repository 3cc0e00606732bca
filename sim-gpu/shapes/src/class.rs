use crate::primitives::Makes;
use crate::{airplane, bottle, bowl, chair, cone, cup, lamp, monitor, table, vase};

/// The makes of each class, and the fraction of its shapes that are rotated by a quarter or half
/// turn. The fractions follow ModelNet40's training clouds: chairs are hardly ever rotated,
/// airplanes and monitors sometimes, vessels have no preferred direction.
pub(super) const FAMILIES: [(Makes, f64); 10] = [
    (airplane::MAKES, 0.15),
    (&[(1, bottle::build)], 0.6),
    (&[(1, bowl::build)], 0.6),
    (&[(1, chair::build)], 0.02),
    (cone::MAKES, 0.6),
    (&[(1, cup::build)], 0.6),
    (lamp::MAKES, 0.3),
    (monitor::MAKES, 0.3),
    (&[(1, table::build)], 0.15),
    (&[(1, vase::build)], 0.6),
];

formats::named! {
    /// One of ten classes with ModelNet40's names, in the order of their labels.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Readers of folders sort the classes by name; a label is an index in that order.
    #[test]
    fn labels_follow_the_order_of_names() {
        assert!(ShapeClass::ALL.map(ShapeClass::name).is_sorted());
    }
}
