//! Any bytes, taken for any format or for what they begin like, are an error or
//! a cloud that the bytes justify. The first byte chooses the format.

#![no_main]

use std::path::Path;

use formats::cloud_file::{CloudFormat, read_cloud_from};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, content)) = bytes.split_first() else { return };
    let format = CloudFormat::ALL.get(usize::from(*choice)).copied();
    let Ok(cloud) = read_cloud_from(content, format, Path::new("-")) else { return };
    // Three bytes hold a point at the least, of which compression makes at most
    // 1032 times as many.
    assert!(cloud.points.len() <= content.len() * 1032 / 3);
});
