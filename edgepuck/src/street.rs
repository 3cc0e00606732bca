//! The classes of streets, as `street-128` knows them.

use plotters::style::RGBColor;

/// A class of streets.
#[derive(Clone, Copy)]
pub struct StreetClass {
    pub name: &'static str,
    /// KITTI's type for it.
    pub kitti: &'static str,
    /// Its colour in pictures.
    pub tint: RGBColor,
}

const STREET: [StreetClass; 5] = [
    StreetClass { name: "bus", kitti: "Misc", tint: RGBColor(0, 90, 210) },
    StreetClass { name: "car", kitti: "Car", tint: RGBColor(210, 20, 40) },
    StreetClass { name: "person", kitti: "Pedestrian", tint: RGBColor(0, 140, 60) },
    StreetClass { name: "truck", kitti: "Truck", tint: RGBColor(220, 110, 0) },
    StreetClass { name: "two-wheeler", kitti: "Cyclist", tint: RGBColor(150, 30, 180) },
];

impl StreetClass {
    pub fn named(name: &str) -> Option<Self> {
        STREET.into_iter().find(|class| class.name == name)
    }
}
