mod columns;
mod damaged;
#[cfg(feature = "dataset")]
mod kitti;
mod las;
mod npy;
mod npz;
mod pcd;
mod ply;
mod real_scans;
mod text;
mod written;

use std::path::Path;

use formats::cloud_file::{CloudFormat, read_cloud_from};

fn read(name: &str, bytes: impl AsRef<[u8]>) -> Vec<[f64; 3]> {
    let name = Path::new(name);
    read_cloud_from(bytes.as_ref(), Some(CloudFormat::of_path(name).unwrap()), name).unwrap().points
}

/// What is wrong with `bytes`, taken for a file called `name`, after that name.
fn error(name: &str, bytes: impl AsRef<[u8]>) -> String {
    let path = Path::new(name);
    let read = read_cloud_from(bytes.as_ref(), Some(CloudFormat::of_path(path).unwrap()), path);
    let message = read.unwrap_err().to_string();
    message.strip_prefix(&format!("{name}: ")).unwrap_or(&message).to_owned()
}

#[test]
fn faults_are_named_with_their_lines() {
    for (file, message) in test_support::said::faults(include_str!("faults.txt")) {
        let name_ends = file.windows(3).position(|part| part == b" | ").unwrap();
        let (name, bytes) = (str::from_utf8(&file[..name_ends]).unwrap(), &file[name_ends + 3..]);
        assert_eq!(error(name, bytes), message, "{}", String::from_utf8_lossy(&file));
    }
}

/// A header that promises more points than any memory holds.
const MANY: &str = "1000000000000000000";
