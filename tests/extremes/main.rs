//! What the product does at the ends of what it may be given.
//!
//! A case is a file: `cases/KIND/NAME.toml`. It holds what goes in, at most one
//! knob and its values, what must come out, and in words why (`derivation`).
//! Each runs on every caster there is, or, where it classifies, in every
//! precision and on every kernel. To add a case, add a file: it is found, and
//! its name is the test's. [`case`] has the keys that all share, the file named
//! for a kind has that kind's. A key that is unknown fails the run.
//!
//! Cases that take gigabytes or minutes say `heavy = true`: they run where
//! `EDGEPUCK_HEAVY=1`, and are named as skipped where not. What no table says
//! plainly, a relation between several scans, is in [`rules`].

#![expect(clippy::unwrap_used, reason = "tests")]

mod case;
mod chain;
mod classify;
mod cloud;
mod effect;
mod model;
mod rules;
mod sample;
mod scan;
mod scene;
mod shape;
mod stream;
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
