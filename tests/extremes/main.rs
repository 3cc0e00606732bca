//! Tests with extreme inputs.
//!
//! A case is a file `cases/KIND/NAME.toml`. It holds the input, at most one parameter with several
//! values, the expected output, and its derivation in words (`derivation`). A case runs on all
//! casters or, if it classifies, in all precisions and with all kernels. To add a case, add a file,
//! whose name becomes the name of the test. [`case`] has the keys of all kinds, and the module
//! named after a kind has the keys of that kind. An unknown key fails the run.
//!
//! Cases that need gigabytes or minutes have `heavy = true`. They run if `EDGEPUCK_HEAVY=1`;
//! otherwise, they are reported as skipped. [`rules`] tests relations between several scans, which
//! a table cannot express.

#![expect(clippy::unwrap_used, reason = "tests")]

mod case;
mod chain;
mod classify;
mod cloud;
mod effect;
mod model;
mod rules;
mod scan;
mod scene;
mod shape;
mod sweep;
#[path = "../../infer-cpu/tests/support/tiny_model.rs"]
mod tiny_model;

use std::process::ExitCode;

use libtest_mimic::Arguments;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let mut trials = case::trials();
    trials.extend(rules::trials());
    libtest_mimic::run(&arguments, trials).exit_code()
}
