//! Clouds for the tests of samplers.

use formats::rng::StreamKey;
use proptest::prelude::*;

pub fn shuffled(cloud: &[[f32; 3]], seed: u32) -> Vec<[f32; 3]> {
    let key = StreamKey::new(0, "shuffled", seed);
    let mut shuffled: Vec<_> = (0..).map(|i| key.unit(i)).zip(cloud.iter().copied()).collect();
    shuffled.sort_by(|a, b| a.0.total_cmp(&b.0));
    shuffled.into_iter().map(|(_, point)| point).collect()
}

/// `n` points, uniform in the cube from -1 to 1.
pub fn uniform(n: usize, seed: u32) -> Vec<[f32; 3]> {
    let key = StreamKey::new(0, "uniform", seed);
    let coordinate = |i: usize| key.unit(i as u64) as f32 * 2.0 - 1.0;
    (0..n).map(|i| [0, 1, 2].map(|axis| coordinate(3 * i + axis))).collect()
}

pub fn gather(cloud: &[[f32; 3]], indices: &[u32]) -> Vec<[f32; 3]> {
    indices.iter().map(|&index| cloud[index as usize]).collect()
}

/// Clouds full of ties and duplicates, on a coarse grid with zeros of both signs, and clouds of any
/// finite numbers.
pub fn any_cloud() -> impl Strategy<Value = Vec<[f32; 3]>> {
    let grid = (-2i8..=2).prop_map(|x| f32::from(x) * 0.5);
    let grid = prop_oneof![grid, Just(-0.0f32)];
    let finite = prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO;
    prop_oneof![
        prop::collection::vec(prop::array::uniform3(grid), 0..80),
        prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), 0..80),
        prop::collection::vec(prop::array::uniform3(finite), 0..40),
    ]
}

/// Clouds with extreme coordinates, and the number of distinct points of each.
pub fn extremes() -> Vec<(&'static str, Vec<[f32; 3]>, usize)> {
    let outlier = [uniform(99, 1), vec![[1e9, 0.0, 0.0]]].concat();
    let scaled = |by: f32| uniform(100, 2).into_iter().map(|p| p.map(|x| x * by)).collect();
    vec![
        ("no point", vec![], 0),
        ("one point", vec![[0.3, 0.2, 0.1]], 1),
        ("all points equal", vec![[0.3, 0.2, 0.1]; 100], 1),
        ("all points at 0, with either sign", [[[0.0; 3]; 9], [[-0.0; 3]; 9]].concat(), 1),
        ("coordinates at 1e30", scaled(1e30), 100),
        ("coordinates at 1e-30", scaled(1e-30), 100),
        ("the ends of f32", vec![[f32::MAX; 3], [f32::MIN; 3], [0.0; 3]], 3),
        ("the least of f32", vec![[1e-45; 3], [-1e-45; 3], [0.0; 3]], 3),
        ("one outlier", outlier, 100),
    ]
}

/// The data of the first NumPy array in the file at `relative` below `../shared/data`, an array or
/// an uncompressed archive; an error if the file is absent.
pub fn shared_array(relative: &str, descr: &str) -> Result<Vec<u8>, String> {
    const MAGIC: &[u8] = b"\x93NUMPY\x01\0";
    let bytes = std::fs::read(test_support::shared_data(relative)?).unwrap();
    let array = bytes.windows(MAGIC.len()).position(|window| window == MAGIC).unwrap();
    let (length, header) = bytes[array + MAGIC.len()..].split_first_chunk().unwrap();
    let (header, data) = header.split_at(u16::from_le_bytes(*length).into());
    assert!(String::from_utf8_lossy(header).contains(&format!("'descr': '{descr}'")));
    Ok(data.to_vec())
}
