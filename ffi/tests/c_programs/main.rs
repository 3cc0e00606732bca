//! Tests the library from C: the examples print the results of the Rust libraries, and the programs of
//! `tests/c` check the statements of the header. Skipped with a message if there is no C compiler. The
//! header itself is what cbindgen makes of the sources.

#![expect(clippy::unwrap_used, reason = "tests")]

mod classify;
mod compiler;
mod model;
mod scan;
#[path = "../../../infer-cpu/tests/support/street.rs"]
#[allow(dead_code, reason = "the tests of infer-cpu use all of it")]
mod street;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use compiler::{Compiler, dynamic_link, static_link};
use test_support::need;

fn run(program: &Path, arguments: &[&Path]) -> Output {
    Command::new(program).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Writes an input of a program beside it.
fn write(compiler: &Compiler, name: &str, content: &str) -> PathBuf {
    let file = compiler.folder().join(name);
    std::fs::write(&file, content).unwrap();
    file
}

/// Runs a program of `tests/c`, which prints the version and each expectation that fails, linked with the
/// archive and with the shared library.
fn assert_program_succeeds(compiler: &Compiler, source: &str, arguments: &[&Path]) {
    for link in [static_link(), dynamic_link()] {
        let program = compiler.compile(source, &link);
        let output = run(&program, arguments);
        assert!(output.status.success(), "{link:?}\n{}", text(&output.stderr));
        assert_eq!(text(&output.stdout), concat!(env!("CARGO_PKG_VERSION"), "\n"));
    }
}

#[test]
fn the_header_is_c_plus_plus_too() {
    let compiler = need!(Compiler::c_plus_plus());
    let program = compiler.compile("tests/c/version.cpp", &static_link());
    assert!(run(&program, &[]).status.success());
}
