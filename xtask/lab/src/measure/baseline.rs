//! The layers of the network that engines are compared on, and random numbers for them.

use formats::rng::StreamKey;
use formats::weights::Tensor;

/// The stacks of `pointnet_cls` of yanx27/Pointnet_Pointnet2_pytorch for 40 classes: what
/// the names of their layers begin with, and their widths. The last is the front end of a
/// Critical Points Layer, as wide as the trunk.
pub const STACKS: [(&str, &[usize]); 7] = [
    ("feat.stn.conv", &[3, 64, 128, 1024]),
    ("feat.stn.fc", &[1024, 512, 256, 9]),
    ("feat.fstn.conv", &[64, 64, 128, 1024]),
    ("feat.fstn.fc", &[1024, 512, 256, 64 * 64]),
    ("feat.conv", &[3, 64, 128, 1024]),
    ("fc", &[1024, 512, 256, 40]),
    ("cpl.conv", &[3, 64, 128, 1024]),
];

/// A tensor of random numbers: `number` of each of the numbers of `key` in [0, 1).
pub fn drawn(key: StreamKey, shape: &[usize], number: impl Fn(f64) -> f64) -> Tensor {
    let count = shape.iter().product::<usize>() as u64;
    let values = (0..count).map(|i| number(key.unit(i)) as f32).collect();
    Tensor { shape: shape.to_vec(), values }
}
