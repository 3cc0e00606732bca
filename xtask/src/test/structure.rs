//! Checks of the source that neither rustc nor Clippy makes: modules do not depend on each other in
//! circles, `unsafe` stands only where CONTRIBUTING.md allows it, libraries do not print, all streams
//! of random numbers are in one list, and links lead to files.

mod circles;
mod links;
mod modules;
#[cfg(test)]
mod reference;
mod tokens;

use crate::summary::{Counts, Summary};
use anyhow::Context;
use modules::Modules;
use std::fs;
use std::path::Path;
use xtask::workspace::{packages, root};

/// The folders of developers' programs and of tests, which may print and allocate as they need.
const OURS: [&str; 2] = ["tests", "xtask"];

/// The manifests of all workspaces that are checked.
const MANIFESTS: [&str; 2] = ["Cargo.toml", "xtask/lab/Cargo.toml"];

/// A crate: its name in code, its modules, and whether it is a library of the product.
struct Crate {
    name: String,
    modules: Modules,
    is_library: bool,
}

pub fn check(summary: &mut Summary) -> anyhow::Result<Counts> {
    let crates = crates()?;
    let unsafe_allowed = quoted_in("CONTRIBUTING.md", "- **`unsafe` blocks**")?;
    let printing_allowed = quoted_in("ARCHITECTURE.md", "- Libraries do not print")?;
    let mut counts = Counts::default();
    for (name, faults) in [
        ("circles", crates.iter().flat_map(circles).collect::<Vec<_>>()),
        (
            "unsafe",
            crates.iter().flat_map(|found| misplaced_unsafe(found, &unsafe_allowed)).collect(),
        ),
        ("links", links::broken()?),
        ("printing", crates.iter().flat_map(|found| printing(found, &printing_allowed)).collect()),
        ("streams", crates.iter().flat_map(unlisted_streams).collect()),
    ] {
        counts = counts.and(if faults.is_empty() { Counts::PASSED } else { Counts::FAILED });
        faults.iter().for_each(|fault| summary.remark(format!("{name}: FAILED, {fault}")));
    }
    Ok(counts)
}

fn crates() -> anyhow::Result<Vec<Crate>> {
    let mut crates = Vec::new();
    for package in MANIFESTS.map(packages).into_iter().collect::<anyhow::Result<Vec<_>>>()?.concat()
    {
        for target in package["targets"].as_array().into_iter().flatten() {
            let kind = target["kind"][0].as_str().unwrap_or_default();
            let file = Path::new(target["src_path"].as_str().unwrap_or_default());
            if matches!(kind, "test" | "example" | "bench" | "custom-build") {
                continue;
            }
            let folder = file.strip_prefix(root()).unwrap_or(file);
            crates.push(Crate {
                name: target["name"].as_str().unwrap_or_default().replace('-', "_"),
                modules: modules::read(file)?,
                is_library: kind != "bin" && !OURS.iter().any(|ours| folder.starts_with(ours)),
            });
        }
    }
    Ok(crates)
}

/// The texts between backquotes in the paragraph of `file` that begins with `beginning`.
fn quoted_in(file: &str, beginning: &str) -> anyhow::Result<Vec<String>> {
    let text = fs::read_to_string(root().join(file)).with_context(|| file.to_owned())?;
    let (_, paragraph) = text
        .split_once(beginning)
        .with_context(|| format!("{file}: expected a paragraph `{beginning} ...`, found none"))?;
    let paragraph = paragraph.split("\n- ").next().unwrap_or_default();
    Ok(paragraph.split('`').skip(1).step_by(2).map(str::to_owned).collect())
}

fn circles(found: &Crate) -> Vec<String> {
    let circles = circles::find(&found.modules).into_iter();
    circles.map(|line| format!("in a circle of {}: {line}", found.name)).collect()
}

/// The uses of `unsafe` outside the `allowed` files and folders.
fn misplaced_unsafe(found: &Crate, allowed: &[String]) -> Vec<String> {
    let modules = found.modules.values().filter(|module| {
        let file = module.file.strip_prefix(root()).unwrap_or(&module.file);
        !file.starts_with("tests") && !allowed.iter().any(|allowed| file.starts_with(allowed))
    });
    let lines =
        modules.filter_map(|module| Some((module, module.paths.get(&["unsafe".to_owned()][..])?)));
    lines.map(|(module, line)| format!("{}:{line} is unsafe", module.file.display())).collect()
}

/// What writes to the terminal in a library, outside the modules that may: `allowed` has their paths.
fn printing(found: &Crate, allowed: &[String]) -> Vec<String> {
    const WRITERS: [&str; 7] =
        ["print", "println", "eprint", "eprintln", "dbg", "stdout", "stderr"];
    let may_print = |name: &[String]| {
        let name = [std::slice::from_ref(&found.name), name].concat().join("::");
        allowed.iter().any(|allowed| name == *allowed || name.starts_with(&format!("{allowed}::")))
    };
    let modules = found.modules.iter().filter(|(name, _)| found.is_library && !may_print(name));
    let writes = |path: &[String]| path.last().is_some_and(|last| WRITERS.contains(&last.as_str()));
    modules.flat_map(|(_, module)| module.lines_with(writes)).collect()
}

/// The keys of random numbers that a library makes outside the list of all streams.
fn unlisted_streams(found: &Crate) -> Vec<String> {
    let modules = found.modules.values().filter(|_| found.is_library);
    let others = modules.filter(|module| !module.file.ends_with("formats/src/streams.rs"));
    let makes_key = |path: &[String]| path.ends_with(&["StreamKey", "new"].map(str::to_owned));
    others.flat_map(|module| module.lines_with(makes_key)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crate_of(source: &str) -> Crate {
        let mut modules = Modules::new();
        assert!(modules::parse(source, Path::new("a/src/lib.rs"), &[], &mut modules).is_empty());
        Crate { name: "a".to_owned(), modules, is_library: true }
    }

    #[test]
    fn a_circle_of_modules_is_found_and_its_uses_are_named() {
        let faults = circles(&crate_of(
            "pub mod mesh { pub mod read { pub struct Reader; fn f() { crate::scene::new(); } } }
             pub use mesh::read::Reader;
             mod scene { use crate::{Reader as R, pose::Pose}; pub fn new() -> R { R } }
             mod pose { pub struct Pose; }",
        ));
        let expected = ["mesh::read uses new of scene", "scene uses Reader of mesh::read"];
        assert_eq!(faults, expected.map(|line| format!("in a circle of a: {line}")));
    }

    #[test]
    fn neither_tests_nor_comments_nor_texts_nor_parents_nor_exports_make_a_circle() {
        let faults = circles(&crate_of(
            r##"mod a { pub struct A; #[cfg(test)] mod tests { use crate::b::B; }
                        // crate::b::B
                        const TEXT: &str = r#" " crate::b::B "#; const QUOTE: char = '"'; }
                mod b { pub use crate::a::A; pub struct B<'a>(&'a A); pub use inside::C;
                        mod inside { pub struct C(super::B); } fn f(c: C) {} }"##,
        ));
        assert_eq!(faults, [""; 0]);
    }

    #[test]
    fn unsafe_code_is_found_outside_the_folders_that_may_have_it() {
        let found = crate_of("//! unsafe\nmod a {\n fn f() { unsafe { g() } } }");
        assert_eq!(misplaced_unsafe(&found, &[]), ["a/src/lib.rs:3 is unsafe"]);
        assert_eq!(misplaced_unsafe(&found, &["a/src".to_owned()]), [""; 0]);
    }

    #[test]
    fn streams_outside_the_list_are_found() {
        let mut found = crate_of("mod b { fn f() { formats::rng::StreamKey::new(0, \"f\", 0); } }");
        let faults = ["a/src/lib.rs:1 has formats::rng::StreamKey::new"];
        assert_eq!(unlisted_streams(&found), faults);
        found.is_library = false;
        assert_eq!(unlisted_streams(&found), [""; 0]);
    }

    #[test]
    fn printing_is_found_in_libraries_outside_the_modules_that_may() {
        let source = "mod b { fn f() { println!(); } mod c { fn g() { std::io::stderr(); } } }";
        let mut found = crate_of(source);
        let faults = ["a/src/lib.rs:1 has println", "a/src/lib.rs:1 has std::io::stderr"];
        assert_eq!(printing(&found, &[]), faults);
        assert_eq!(printing(&found, &["a::b::c".to_owned()]), faults[..1]);
        assert_eq!(printing(&found, &["a".to_owned()]), [""; 0]);
        found.is_library = false;
        assert_eq!(printing(&found, &[]), [""; 0]);
    }
}
