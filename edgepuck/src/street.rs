//! The classes of streets, as `street-128` knows them.

use plotters::style::RGBColor;

/// A class of streets.
#[derive(Clone, Copy)]
pub struct StreetClass {
    pub name: &'static str,
    /// KITTI's type for it.
    pub kitti: &'static str,
    /// The usual length and width, metres: the anchors of OpenPCDet's configurations for KITTI
    /// (pointpillar.yaml), and for trucks and buses those for nuScenes (cbgs_pp_multihead.yaml).
    pub usual_m: [f32; 2],
    /// Its colour in pictures.
    pub tint: RGBColor,
}

const STREET: [StreetClass; 5] = [
    StreetClass { name: "bus", kitti: "Misc", usual_m: [10.5, 2.94], tint: RGBColor(0, 90, 210) },
    StreetClass { name: "car", kitti: "Car", usual_m: [3.9, 1.6], tint: RGBColor(210, 20, 40) },
    StreetClass {
        name: "person",
        kitti: "Pedestrian",
        usual_m: [0.8, 0.6],
        tint: RGBColor(0, 140, 60),
    },
    StreetClass {
        name: "truck",
        kitti: "Truck",
        usual_m: [6.93, 2.51],
        tint: RGBColor(220, 110, 0),
    },
    StreetClass {
        name: "two-wheeler",
        kitti: "Cyclist",
        usual_m: [1.76, 0.6],
        tint: RGBColor(150, 30, 180),
    },
];

impl StreetClass {
    pub fn named(name: &str) -> Option<Self> {
        STREET.into_iter().find(|class| class.name == name)
    }
}
