//! LLVM's machine code analyser, as a model of the Cortex-A76.
//!
//! Neoverse N1 is the same core for servers: two 128-bit FMA pipes, dispatch
//! and latencies from Arm's optimisation guide. LLVM's own `cortex-a76` is an
//! alias of the Cortex-A57, which has half the throughput.

use anyhow::{Context, bail};
use serde_json::Value;
use std::io::Write;
use std::process::{Command, Stdio};

/// The first release that models Neoverse N1.
const LEAST_VERSION: u32 = 19;
/// Releases looked for by name, the newest first, before plain `llvm-mca`.
const VERSIONS: std::ops::RangeInclusive<u32> = LEAST_VERSION..=24;
/// The core modelled.
const CORE: &str = "neoverse-n1";
/// Times that code is repeated, so that getting under way weighs nothing.
const ITERATIONS: u32 = 1000;

/// An llvm-mca that models the core.
pub struct Mca {
    program: String,
    /// What it says of itself.
    pub version: String,
}

/// One repetition of some code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Cycles, when repeated for long.
    pub cycles: f64,
    /// Instructions.
    pub instructions: f64,
}

impl Mca {
    /// `given`, or the newest that there is.
    ///
    /// # Errors
    /// None, or none that models the core; with what to do about it.
    pub fn find(given: Option<&str>) -> anyhow::Result<Self> {
        let mut names: Vec<String> = VERSIONS.rev().map(|n| format!("llvm-mca-{n}")).collect();
        names.push("llvm-mca".to_owned());
        if let Some(given) = given {
            names = vec![given.to_owned()];
        }
        let found = names.into_iter().find_map(|program| {
            let output = Command::new(&program).arg("--version").output().ok()?;
            let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
            let version =
                stdout.lines().find(|line| line.contains("LLVM version"))?.trim().to_owned();
            (major(&version)? >= LEAST_VERSION).then_some(Self { program, version })
        });
        let Some(mca) = found else {
            let which = given.unwrap_or("llvm-mca");
            bail!(
                "there is no {which} of LLVM {LEAST_VERSION} or newer, which knows {CORE}: install \
                 a package such as llvm-22 or llvm-19 (Debian, Ubuntu), or give --llvm-mca"
            );
        };
        mca.check()?;
        Ok(mca)
    }

    /// That two FMA a cycle are modelled; an analyser that does not know the
    /// core takes another's model without a word.
    fn check(&self) -> anyhow::Result<()> {
        let fmla = |n: usize| format!("\tfmla\tv{n}.4s, v30.4s, v31.s[0]\n");
        let cycles = self.cost(&(0..16).map(fmla).collect::<String>())?.cycles;
        if (cycles - 8.0).abs() > 0.1 {
            bail!("{} takes {cycles:.2} cycles for 16 FMLA, {CORE} takes 8", self.program);
        }
        Ok(())
    }

    /// What one repetition of `code` costs.
    ///
    /// # Errors
    /// Code that cannot be assembled, with what the analyser said.
    pub fn cost(&self, code: &str) -> anyhow::Result<Cost> {
        let mut command = Command::new(&self.program);
        command.args(["-mtriple=aarch64-linux-gnu", "-mattr=+fullfp16,+dotprod", "--json"]);
        command.args([format!("-mcpu={CORE}"), format!("-iterations={ITERATIONS}")]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().with_context(|| format!("cannot run {}", self.program))?;
        let mut input = child.stdin.take().context("a pipe to the analyser")?;
        // One that refuses the code early says why on its standard error.
        let written = input.write_all(code.as_bytes());
        drop(input);
        let output = child.wait_with_output()?;
        if !output.status.success() {
            let stderr = String::from_utf8_lossy(&output.stderr);
            bail!("{} refuses the code: {}", self.program, stderr.trim());
        }
        written?;
        parse(&String::from_utf8_lossy(&output.stdout))
    }
}

/// `22` of `Debian LLVM version 22.1.8`.
fn major(version: &str) -> Option<u32> {
    let (_, number) = version.split_once("LLVM version")?;
    number.trim().split('.').next()?.parse().ok()
}

/// Reads llvm-mca's JSON of one region.
fn parse(json: &str) -> anyhow::Result<Cost> {
    let report: Value = serde_json::from_str(json).context("llvm-mca's answer is no JSON")?;
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

    #[test]
    fn reads_the_release() {
        assert_eq!(major("Debian LLVM version 22.1.8"), Some(22));
        assert_eq!(major("LLVM version 19.1.7"), Some(19));
        assert_eq!(major("gcc 12"), None);
    }
}
