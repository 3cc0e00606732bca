//! The names and widths of the baseline network.

/// The parts of a network by the prefix of their layers' names: point-wise layers, then
/// dense layers. The last part is the front end of a Critical Points Layer.
pub const PARTS: [[&str; 2]; 4] = [
    ["feat.stn.conv", "feat.stn.fc"],
    ["feat.fstn.conv", "feat.fstn.fc"],
    ["feat.conv", "fc"],
    ["cpl.conv", "cpl.fc"],
];

/// `pointnet_cls` of yanx27/Pointnet_Pointnet2_pytorch for 40 classes, and a front end as
/// wide as its trunk: widths in the order of [`PARTS`].
pub const WIDTHS: [[&[usize]; 2]; 4] = [
    [&[3, 64, 128, 1024], &[1024, 512, 256, 9]],
    [&[64, 64, 128, 1024], &[1024, 512, 256, 64 * 64]],
    [&[3, 64, 128, 1024], &[1024, 512, 256, 40]],
    [&[3, 64, 128, 1024], &[]],
];
