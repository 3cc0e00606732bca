//! The classes of streets, as `street-128` knows them.

/// A class of streets.
#[derive(Clone, Copy)]
pub struct StreetClass {
    pub name: &'static str,
    /// KITTI's type for it.
    pub kitti: &'static str,
}

const STREET: [StreetClass; 5] = [
    StreetClass { name: "bus", kitti: "Misc" },
    StreetClass { name: "car", kitti: "Car" },
    StreetClass { name: "person", kitti: "Pedestrian" },
    StreetClass { name: "truck", kitti: "Truck" },
    StreetClass { name: "two-wheeler", kitti: "Cyclist" },
];

impl StreetClass {
    pub fn named(name: &str) -> Option<Self> {
        STREET.into_iter().find(|class| class.name == name)
    }
}
