//! Clouds from files and from standard input.

use std::io::stdin;
use std::path::Path;

use formats::FormatError;
use formats::cloud_file::{Cloud, CloudFormat, read_cloud_as, read_cloud_from};

use super::Usage;

const STANDARD_INPUT: &str = "-";

fn is_standard_input(name: &Path) -> bool {
    name.as_os_str() == STANDARD_INPUT
}

/// Reads a cloud from a file or from standard input. Without a `format`, the extension of the file
/// or the first bytes of standard input determine it.
pub fn read(name: &Path, format: Option<CloudFormat>) -> Result<Cloud, FormatError> {
    if is_standard_input(name) {
        return read_cloud_from(stdin().lock(), format, Path::new("standard input"));
    }
    read_cloud_as(name, format)
}

/// Checks that standard input, which holds one cloud, is named at most once.
pub fn check_names<'a>(names: impl IntoIterator<Item = &'a Path>) -> Result<(), Usage> {
    let n = names.into_iter().filter(|name| is_standard_input(name)).count();
    match n {
        0 | 1 => Ok(()),
        _ => Err(Usage(format!(
            "expected `-` once, since standard input holds one cloud, found it {n} times"
        ))),
    }
}
