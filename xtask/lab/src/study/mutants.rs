//! `cargo xtask mutants`: changes the code with cargo-mutants, one place at a time, and counts the
//! changes that the tests notice.
//!
//! `xtask/lab/mutants.toml` says which files are changed and whose tests should notice. The tests
//! run in two passes: those that take seconds, and all for what the first pass missed. Outcomes are
//! kept under `target/mutants`, so that a run that was stopped goes on where it was; the record,
//! `xtask/lab/mutants-record.toml`, counts them and lists the survivors, each with its reason.

use anyhow::{Context, Result, bail};
use clap::Args;
use edgepuck_program::Outcome;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use xtask::workspace::root;

#[derive(Args, Debug)]
pub struct MutantsArgs {
    /// Change these files only, each of which must be in a group of mutants.toml [default: all]
    files: Vec<String>,
    /// Try every N-th change only, as a sample
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
}

/// `mutants.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plan {
    group: Vec<Group>,
    excluded: Vec<Excluded>,
}

/// Files, and the packages whose tests see them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Group {
    name: String,
    files: Vec<String>,
    first: Vec<String>,
    then: Vec<String>,
}

/// Mutants that no test should notice.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Excluded {
    mutants: String,
    #[expect(dead_code, reason = "a reader of the file wants to know")]
    reason: String,
}

/// What became of a mutant, by the name of cargo-mutants's list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Fate {
    Caught,
    /// The tests did not end in time, which a person notices.
    Timeout,
    /// It does not compile.
    Unviable,
    Missed,
}

const FATES: [(Fate, &str); 4] = [
    (Fate::Caught, "caught.txt"),
    (Fate::Timeout, "timeout.txt"),
    (Fate::Unviable, "unviable.txt"),
    (Fate::Missed, "missed.txt"),
];

type Fates = BTreeMap<String, Fate>;

/// `mutants-record.toml`.
#[derive(Default, Serialize, Deserialize)]
struct Record {
    #[serde(default)]
    group: Vec<Count>,
    #[serde(default)]
    survivor: Vec<Survivor>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Count {
    name: String,
    mutants: usize,
    tried: usize,
    unviable: usize,
    caught: usize,
    missed: usize,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Survivor {
    mutant: String,
    /// Why no test notices it; empty until somebody has looked.
    reason: String,
}

pub fn run(args: &MutantsArgs) -> Result<Outcome> {
    let plan: Plan = toml::from_str(&fs::read_to_string(root().join("xtask/lab/mutants.toml"))?)?;
    let path = root().join("xtask/lab/mutants-record.toml");
    let mut record: Record = match path.exists() {
        true => toml::from_str(&fs::read_to_string(&path)?).context("mutants-record.toml")?,
        false => Record::default(),
    };
    for group in &plan.group {
        let listed = group.listed(&plan.excluded)?;
        let is_wanted = |name: &&String| {
            args.files.is_empty() || args.files.iter().any(|file| name.starts_with(&**file))
        };
        let wanted: Vec<&String> =
            listed.iter().filter(is_wanted).step_by(args.every as usize).collect();
        if wanted.is_empty() {
            continue;
        }
        let fates = group.tried(&wanted, &plan.excluded)?;
        // An edit of a file gives its mutants new names.
        let known = fates.into_iter().filter(|(name, _)| listed.contains(name)).collect();
        record.take(group, listed.len(), &known);
        // Written after each group, since a run takes hours.
        fs::write(&path, toml::to_string(&record)?)?;
    }
    for Count { name, mutants, tried, unviable, caught, missed } in &record.group {
        let share = 100.0 * *caught as f64 / (caught + missed).max(1) as f64;
        println!(
            "{name}: {tried} of {mutants} tried, {unviable} do not compile, {caught} caught \
             ({share:.0} %), {missed} missed"
        );
    }
    let unknown = record.survivor.iter().filter(|survivor| survivor.reason.is_empty()).count();
    println!("{unknown} survivors have no reason in {}", path.display());
    Ok(if unknown == 0 { Outcome::Success } else { Outcome::SomeFailed })
}

impl Group {
    /// The names of all mutants of the group's files.
    fn listed(&self, excluded: &[Excluded]) -> Result<BTreeSet<String>> {
        let mut list = mutants(excluded);
        list.arg("--list").args(self.files.iter().flat_map(|files| ["--file", files]));
        let output = list.output().context("cargo mutants")?;
        if !output.status.success() {
            let cause = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            bail!("{cause}: `cargo install --locked cargo-mutants` installs it");
        }
        Ok(String::from_utf8(output.stdout)?.lines().map(str::to_owned).collect())
    }

    /// The fates of all mutants that were tried, `wanted` among them.
    fn tried(&self, wanted: &[&String], excluded: &[Excluded]) -> Result<Fates> {
        let folder = root().join("target/mutants").join(&self.name);
        fs::create_dir_all(&folder)?;
        let mut fates = gather(&folder)?;
        let all = [&self.first[..], &self.then].concat();
        for (pass, packages) in [("first", &self.first), ("then", &all)] {
            let missed_at_first = fates.clone();
            let is_left = |name: &&&String| match missed_at_first.get(**name) {
                None => pass == "first",
                Some(fate) => pass == "then" && *fate == Fate::Missed,
            };
            let left: Vec<&&String> = wanted.iter().filter(is_left).collect();
            if left.is_empty() {
                continue;
            }
            let mut run = mutants(excluded);
            run.args(["--baseline", "skip", "--timeout", "200", "--no-shuffle", "--output"]);
            run.arg(folder.join(pass));
            run.args(packages.iter().flat_map(|package| ["--test-package", package]));
            // cargo-mutants 27.1 tries fields that are left out whatever the `--re`.
            let file = |name: &&&String| name.split(':').next().unwrap_or_default().to_owned();
            let files: BTreeSet<String> = left.iter().map(file).collect();
            run.args(files.iter().flat_map(|file| ["--file", file]));
            for name in left {
                run.args(["--re", &format!("^{}$", escaped(name))]);
            }
            fs::create_dir_all(folder.join(pass))?;
            run.env("CARGO_TARGET_DIR", root().join("target/mutants/build"));
            // It fails if a mutant is missed; what it wrote says more.
            run.status().context("cargo mutants")?;
            fates = gather(&folder)?;
        }
        Ok(fates)
    }
}

/// cargo-mutants on the product's workspace.
fn mutants(excluded: &[Excluded]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // Formats are features.
    command.args(["mutants", "--workspace", "--all-features", "--colors", "never"]);
    command.current_dir(root());
    command.args(excluded.iter().flat_map(|one| ["--exclude-re", &one.mutants]));
    command
}

/// Reads what the runs of a group wrote, the last of each pass and those before, and keeps it in
/// `fates.toml`. A mutant that any pass caught is caught.
fn gather(folder: &Path) -> Result<Fates> {
    let kept = folder.join("fates.toml");
    let mut fates: Fates = match kept.exists() {
        true => toml::from_str(&fs::read_to_string(&kept)?)?,
        false => Fates::new(),
    };
    for pass in ["first", "then"] {
        for (fate, file) in FATES {
            let list: PathBuf = folder.join(pass).join("mutants.out").join(file);
            for name in fs::read_to_string(list).unwrap_or_default().lines() {
                let known = fates.entry(name.to_owned()).or_insert(fate);
                *known = fate.min(*known);
            }
        }
    }
    fs::write(kept, toml::to_string(&fates)?)?;
    Ok(fates)
}

/// A regular expression for this text.
fn escaped(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || " _/:,<>=&'\"".contains(c);
    text.chars().flat_map(|c| (!is_plain(c)).then_some('\\').into_iter().chain([c])).collect()
}

impl Record {
    /// Replaces what the record says about `group`; survivors keep their reasons.
    fn take(&mut self, group: &Group, mutants: usize, fates: &Fates) {
        let of = |fate| fates.values().filter(|one| **one == fate).count();
        let count = Count {
            name: group.name.clone(),
            mutants,
            tried: fates.len(),
            unviable: of(Fate::Unviable),
            caught: of(Fate::Caught) + of(Fate::Timeout),
            missed: of(Fate::Missed),
        };
        self.group.retain(|known| known.name != group.name);
        self.group.push(count);
        self.group.sort_by(|a, b| a.name.cmp(&b.name));
        let missed = fates.iter().filter(|(_, fate)| **fate == Fate::Missed);
        let missed: BTreeSet<String> = missed.map(|(name, _)| without_place(name)).collect();
        let folder = |mutant: &str| fates.keys().any(|name| same_file(name, mutant));
        self.survivor.retain(|known| missed.contains(&known.mutant) || !folder(&known.mutant));
        for mutant in missed {
            if !self.survivor.iter().any(|known| known.mutant == mutant) {
                self.survivor.push(Survivor { mutant, reason: String::new() });
            }
        }
        self.survivor.sort_by(|a, b| a.mutant.cmp(&b.mutant));
    }
}

fn same_file(a: &str, b: &str) -> bool {
    a.split(':').next() == b.split(':').next()
}

/// A mutant's name without its line and column, which each edit of the file changes.
fn without_place(name: &str) -> String {
    match name.split_once(": ") {
        Some((place, change)) => format!("{}: {change}", place.split(':').next().unwrap_or(place)),
        None => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group() -> Group {
        let text = "name = 'a'\nfiles = ['a/*.rs']\nfirst = ['a']\nthen = []";
        toml::from_str(text).unwrap()
    }

    #[test]
    fn the_plan_reads_and_its_files_exist() {
        let text = fs::read_to_string(root().join("xtask/lab/mutants.toml")).unwrap();
        let plan: Plan = toml::from_str(&text).unwrap();
        for pattern in plan.group.iter().flat_map(|group| &group.files) {
            let folder = pattern.split('*').next().unwrap();
            assert!(root().join(folder).exists(), "{pattern}");
        }
    }

    #[test]
    fn a_survivor_keeps_its_reason_until_a_test_catches_it() {
        let (mut record, group) = (Record::default(), group());
        let fates = |fate| Fates::from([("a/b.rs:3:4: replace + with -".to_owned(), fate)]);
        record.take(&group, 2, &fates(Fate::Missed));
        assert_eq!(record.survivor[0].mutant, "a/b.rs: replace + with -");
        record.survivor[0].reason = "both are 0".to_owned();
        record.take(&group, 2, &fates(Fate::Missed));
        assert_eq!(record.survivor[0].reason, "both are 0");
        assert_eq!((record.group[0].tried, record.group[0].missed), (1, 1));
        record.take(&group, 2, &fates(Fate::Timeout));
        assert_eq!((record.survivor.len(), record.group[0].caught), (0, 1));
    }

    #[test]
    fn the_second_pass_overrules_the_first_and_runs_add_up() {
        let folder = tempfile::tempdir().unwrap();
        let write = |path: &str, text| {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write("first/mutants.out/missed.txt", "x\ny\n");
        write("first/mutants.out/unviable.txt", "z\n");
        write("then/mutants.out/caught.txt", "x\n");
        gather(folder.path()).unwrap();
        fs::remove_dir_all(folder.path().join("then")).unwrap();
        let expected = [("x", Fate::Caught), ("y", Fate::Missed), ("z", Fate::Unviable)];
        assert_eq!(gather(folder.path()).unwrap(), expected.map(|(n, f)| (n.to_owned(), f)).into());
    }

    #[test]
    fn names_become_regular_expressions() {
        let name = "a.rs:1:2: replace f -> [u32; 2] with (0 + 1)";
        assert_eq!(escaped(name), r"a\.rs:1:2: replace f \-> \[u32\; 2\] with \(0 \+ 1\)");
    }
}
