//! How a test says that it cannot run on this machine, and where data that is
//! not part of the repository is.
//!
//! Rust's test harness decides before a test runs whether it is ignored. A test
//! that finds out while it runs calls [`skip`] and returns, most shortly through
//! [`need!`](crate::need). The harness counts it as passed; `cargo xtask test`
//! names a file in [`SKIPPED_TESTS`], and moves each test that wrote a line
//! there from the passed to the skipped.

pub mod allocations;
pub mod said;

use std::env;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Names the file to which each skipped test appends one line.
pub const SKIPPED_TESTS: &str = "EDGEPUCK_SKIPPED_TESTS";

/// Names another folder than `../shared/data` for the developers' data.
pub const SHARED_DATA: &str = "EDGEPUCK_SHARED_DATA";

/// Set to 1, a missing Vulkan adapter fails the tests that want one.
pub const REQUIRE_ADAPTER: &str = "EDGEPUCK_REQUIRE_ADAPTER";

/// Whether the test is probably that of a Raspberry Pi under an emulator, which is
/// slow: only its kernels are its own there, and x86-64 tests all else as well.
pub const IS_EMULATED: bool = !cfg!(target_arch = "x86_64");

/// The value of a `Result` whose error says what is missing here; on an error,
/// the test is reported as skipped and returns. For use in the body of a test.
#[macro_export]
macro_rules! need {
    ($needed:expr) => {
        match $needed {
            Ok(value) => value,
            Err(missing) => return $crate::skip(&missing),
        }
    };
}

/// Reports the test that runs on this thread as skipped. The test must return
/// next, and must not have checked anything before.
///
/// # Panics
/// If the file that [`SKIPPED_TESTS`] names cannot be appended to.
pub fn skip(reason: &str) {
    let program = env::current_exe().unwrap_or_default();
    let program = program.file_stem().unwrap_or_default().to_string_lossy();
    // Cargo appends a hash to the name of a test program.
    let program = program.rsplit_once('-').map_or(&*program, |(name, _)| name);
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    let line = format!("{program}, {test}: SKIPPED, {reason}\n");
    // Unlike `eprint!`, this is not captured by the harness.
    let _ = io::stderr().write_all(line.as_bytes());
    if let Some(file) = env::var_os(SKIPPED_TESTS) {
        let file = OpenOptions::new().append(true).create(true).open(file);
        let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
        written.unwrap_or_else(|error| panic!("{SKIPPED_TESTS}: {error}"));
    }
}

/// A path in the folder of the developers' data: `../shared/data` beside the
/// workspace, or the folder that [`SHARED_DATA`] names.
pub fn shared_data(relative: &str) -> Result<PathBuf, String> {
    let folder = env::var_os(SHARED_DATA).map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = folder.join(relative);
    if path.exists() { Ok(path) } else { Err(format!("{} is missing", path.display())) }
}

/// The adapter that was found.
///
/// # Panics
/// If none was found and [`REQUIRE_ADAPTER`] is 1.
pub fn adapter<A>(found: Option<A>) -> Result<A, String> {
    let none = "this machine has no GPU and no software Vulkan";
    let required = env::var(REQUIRE_ADAPTER).is_ok_and(|value| value == "1");
    assert!(found.is_some() || !required, "{REQUIRE_ADAPTER}=1, but {none}");
    found.ok_or_else(|| none.to_owned())
}

/// The correlation of pairs of numbers of mean 0.
#[must_use]
pub fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let sum = |of: fn(&[f64; 2]) -> f64| pairs.iter().map(of).sum::<f64>();
    sum(|[a, b]| a * b) / (sum(|[a, _]| a * a) * sum(|[_, b]| b * b)).sqrt()
}

/// Checks that pairs of numbers do not correlate: for n pairs of independent numbers the correlation
/// has the standard error 1 / sqrt(n), and 7e-14 of all seeds are 7.5 of them from 0. A test may
/// thus compare 100,000 lists with each of 1,000 seeds.
///
/// # Panics
/// If they do.
pub fn assert_uncorrelated(what: &str, pairs: &[[f64; 2]]) {
    let found = correlation(pairs);
    let bound = 7.5 / (pairs.len() as f64).sqrt();
    assert!(found.abs() < bound, "{what}: a correlation of {found}, not below {bound}");
}
