/// The usual length and width of the known classes of `street-128`, metres: the anchors of OpenPCDet's
/// configurations for KITTI (pointpillar.yaml), and for trucks and buses those for nuScenes
/// (cbgs_pp_multihead.yaml).
const STREET: [(&str, [f32; 2]); 5] = [
    ("bus", [10.5, 2.94]),
    ("car", [3.9, 1.6]),
    ("person", [0.8, 0.6]),
    ("truck", [6.93, 2.51]),
    ("two-wheeler", [1.76, 0.6]),
];

/// The usual length and width of an object of `class`, metres; `None` if they are not known.
#[must_use]
pub fn usual_size_m(class: &str) -> Option<[f32; 2]> {
    STREET.into_iter().find(|(name, _)| *name == class).map(|(_, size_m)| size_m)
}
