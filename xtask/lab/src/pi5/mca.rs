//! LLVM's machine code analyser, as a model of the Cortex-A76.
//!
//! Neoverse N1 is the same core for servers: two 128-bit FMA pipes, dispatch
//! and latencies from Arm's optimisation guide. LLVM's own `cortex-a76` is an
//! alias of the Cortex-A57, which has half the throughput.

use anyhow::{Context, bail};
use serde_json::Value;
use std::process::Command;
use xtask::workspace;

/// The first release that models Neoverse N1.
const LEAST_VERSION: u32 = 19;
/// Releases looked for by name, the newest first, before plain `llvm-mca`.
const VERSIONS: std::ops::RangeInclusive<u32> = LEAST_VERSION..=24;
const CORE: &str = "neoverse-n1";
/// Repetitions of the code, enough to make its start negligible.
const ITERATIONS: u32 = 1000;

/// An llvm-mca that models the core.
pub struct Mca {
    program: String,
    pub version: String,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Cycles, when repeated for long.
    pub cycles: f64,
    pub instructions: f64,
}

impl std::ops::Mul<f64> for Cost {
    type Output = Self;

    fn mul(self, n: f64) -> Self {
        Self { cycles: self.cycles * n, instructions: self.instructions * n }
    }
}

impl std::iter::Sum for Cost {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| Self {
            cycles: a.cycles + b.cycles,
            instructions: a.instructions + b.instructions,
        })
    }
}

impl Mca {
    /// The newest that there is, which must model the core.
    pub fn find() -> anyhow::Result<Self> {
        let names = VERSIONS.rev().map(|n| format!("llvm-mca-{n}")).chain(["llvm-mca".to_owned()]);
        let found = { names }.find_map(|program| {
            let said = workspace::output(Command::new(&program).arg("--version")).ok()?;
            let version =
                said.lines().find(|line| line.contains("LLVM version"))?.trim().to_owned();
            (major(&version)? >= LEAST_VERSION).then_some(Self { program, version })
        });
        let mca = found.with_context(|| {
            format!(
                "expected llvm-mca of LLVM {LEAST_VERSION} or newer, which knows {CORE}, found none: \
                 install a package such as llvm-22 or llvm-19 (Debian, Ubuntu)"
            )
        })?;
        mca.check()?;
        Ok(mca)
    }

    /// Checks that two FMA a cycle are modelled: an analyser that does not know the core uses the
    /// model of another one without a warning.
    fn check(&self) -> anyhow::Result<()> {
        let fmla = |n: usize| format!("\tfmla\tv{n}.4s, v30.4s, v31.s[0]\n");
        let cycles = self.cost(&(0..16).map(fmla).collect::<String>())?.cycles;
        if (cycles - 8.0).abs() > 0.1 {
            bail!(
                "{}: expected 8 cycles for 16 FMLA, as {CORE} takes, found {cycles:.2}",
                self.program
            );
        }
        Ok(())
    }

    /// The cost of one repetition of `code`. An error holds the analyser's message.
    pub fn cost(&self, code: &str) -> anyhow::Result<Cost> {
        let file = tempfile::NamedTempFile::new()?;
        std::fs::write(&file, code)?;
        let mut command = Command::new(&self.program);
        command.args(["-mtriple=aarch64-linux-gnu", "-mattr=+dotprod", "--json"]);
        command.args([format!("-mcpu={CORE}"), format!("-iterations={ITERATIONS}")]);
        parse(&workspace::output(command.arg(file.path()))?)
    }
}

/// `22` of `Debian LLVM version 22.1.8`.
fn major(version: &str) -> Option<u32> {
    let (_, number) = version.split_once("LLVM version")?;
    number.trim().split('.').next()?.parse().ok()
}

fn parse(json: &str) -> anyhow::Result<Cost> {
    let report: Value = serde_json::from_str(json).context("expected JSON from llvm-mca")?;
    let summary = &report["CodeRegions"][0]["SummaryView"];
    let number = |key: &str| {
        summary[key].as_f64().with_context(|| format!("llvm-mca's answer has no {key}"))
    };
    let iterations = number("Iterations")?;
    Ok(Cost {
        cycles: number("TotalCycles")? / iterations,
        instructions: number("Instructions")? / iterations,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_cycles_and_instructions() {
        let json = r#"{"CodeRegions": [{"Instructions": ["fmla\tv0.4s, v1.4s, v2.s[0]"],
            "Name": "", "SummaryView": {"BlockRThroughput": 1.5, "DispatchWidth": 3, "IPC": 0.99,
            "Instructions": 4000, "Iterations": 1000, "TotalCycles": 4008, "TotaluOps": 5000}}],
            "TargetInfo": {"CPUName": "neoverse-n1"}}"#;
        assert_eq!(parse(json).unwrap(), Cost { cycles: 4.008, instructions: 4.0 });
        let error = parse(r#"{"CodeRegions": []}"#).unwrap_err().to_string();
        assert!(error.contains("no Iterations"), "{error}");
        assert!(parse("warning").is_err());
    }
}
