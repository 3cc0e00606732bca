//! The results of a run: counts for each step, and the table that ends the run.

use anyhow::{Context, ensure};
use std::fmt;
use std::process::Command;
use std::time::{Duration, Instant};
use xtask::workspace::words;

/// How many checks passed, failed and were skipped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Checks that ran and found nothing wrong.
    pub passed: u64,
    /// Checks that found something wrong, or could not be run to their end.
    pub failed: u64,
    /// Checks that this machine cannot run, or that are too heavy to run by default.
    pub skipped: u64,
}

impl Counts {
    pub const PASSED: Self = Self { passed: 1, failed: 0, skipped: 0 };
    pub const FAILED: Self = Self { passed: 0, failed: 1, skipped: 0 };

    /// The counts in the last line of a test program's output; `None` for any other line. Rust's
    /// own harness and libtest-mimic write the same line:
    /// `test result: ok. 9 passed; 0 failed; 1 ignored; 0 measured; ...`.
    pub fn of_closing_line(line: &str) -> Option<Self> {
        let (_, counts) = line.trim().strip_prefix("test result: ")?.split_once(". ")?;
        let count = |name: &str| {
            let mut parts = counts.split("; ").map(|part| part.split_once(' '));
            let (number, _) = parts.find_map(|part| part.filter(|(_, found)| *found == name))?;
            number.parse().ok()
        };
        Some(Self {
            passed: count("passed")?,
            failed: count("failed")?,
            skipped: count("ignored")?,
        })
    }

    pub fn and(self, other: Self) -> Self {
        Self {
            passed: self.passed + other.passed,
            failed: self.failed + other.failed,
            skipped: self.skipped + other.skipped,
        }
    }

    /// Counts `n` checks as skipped that were counted as passed.
    pub fn of_which_skipped(self, n: u64) -> Self {
        Self { passed: self.passed.saturating_sub(n), skipped: self.skipped + n, ..self }
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { passed, failed, skipped } = self;
        write!(f, "{passed} passed, {failed} failed, {skipped} skipped")
    }
}

/// The steps of a run so far.
#[derive(Default)]
pub struct Summary {
    steps: Vec<(String, Duration, Counts)>,
    /// A sentence for each check that was skipped or failed, with the reason.
    remarks: Vec<String>,
}

impl Summary {
    /// Runs one step. An error of `check` is a failure of the step, and does not stop the run.
    pub fn step(&mut self, name: &str, check: impl FnOnce(&mut Self) -> anyhow::Result<Counts>) {
        let start = Instant::now();
        let counts = check(self).unwrap_or_else(|error| {
            eprintln!("== {name}: FAILED, {error:#}");
            self.remark(format!("{name}: FAILED, {error:#}"));
            Counts::FAILED
        });
        eprintln!("== {name}: {:.0} s, {counts}", start.elapsed().as_secs_f64());
        self.steps.push((name.to_owned(), start.elapsed(), counts));
    }

    /// Runs one step that is a single command.
    pub fn command(&mut self, name: &str, command: &mut Command) {
        self.step(name, |_| check(name, command));
    }

    /// Counts `n` checks as skipped, and keeps the reason for the end of the run.
    pub fn skip(&mut self, name: &str, n: usize, reason: &str) -> Counts {
        self.remark(format!("{name}: SKIPPED, {reason}"));
        Counts { skipped: n as u64, ..Counts::default() }
    }

    /// Adds the steps that have run beside those of `self`.
    pub fn append(&mut self, others: Self) {
        self.steps.extend(others.steps);
        self.remarks.extend(others.remarks);
    }

    pub fn remark(&mut self, remark: String) {
        self.remarks.push(remark);
    }

    pub fn total(&self) -> Counts {
        self.steps.iter().fold(Counts::default(), |total, (.., counts)| total.and(*counts))
    }

    /// Prints the table, and gives the exit code: 1 if a check failed, 0 otherwise.
    pub fn end(&self) -> u8 {
        println!("{self}");
        u8::from(self.total().failed > 0)
    }
}

/// Prints a command and runs it as one check. Its output goes to the terminal.
pub fn check(name: &str, command: &mut Command) -> anyhow::Result<Counts> {
    let shown = words(command);
    eprintln!("== {name}: {shown}");
    let status = command.status().with_context(|| format!("cannot run {shown}"))?;
    ensure!(status.success(), "it ended with {status}: {shown}");
    Ok(Counts::PASSED)
}

impl fmt::Display for Summary {
    /// The remarks, the table of steps, and the total as the last line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for remark in &self.remarks {
            writeln!(f, "{remark}")?;
        }
        let width = self.steps.iter().map(|(name, ..)| name.len()).max().unwrap_or(0).max(4);
        writeln!(f, "{:width$}  seconds   passed   failed  skipped", "step")?;
        for (name, time, Counts { passed, failed, skipped }) in &self.steps {
            let seconds = time.as_secs_f64();
            writeln!(f, "{name:width$}  {seconds:>7.0}  {passed:>7}  {failed:>7}  {skipped:>7}")?;
        }
        write!(f, "{}", self.total())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_lines_of_test_programs_are_counted_and_others_are_not() {
        let passed = "ok. 59 passed; 0 failed; 1 ignored; 0 measured; finished in 0.31s";
        let failed = "FAILED. 1 passed; 22 failed; 0 ignored; 0 measured; 0 filtered out\n";
        let of = |[passed, failed, skipped]: [u64; 3]| Counts { passed, failed, skipped };
        for (line, expected) in [
            (passed, Some(of([59, 0, 1]))),
            (failed, Some(of([1, 22, 0]))),
            ("", None),
            ("ok. many passed; 0 failed; 0 ignored; 0 measured", None),
            ("ok. 1 passed; 0 failed", None),
        ] {
            let line = format!("test result: {line}");
            assert_eq!(Counts::of_closing_line(&line), expected, "{line}");
            assert_eq!(Counts::of_closing_line(&format!("found {line}")), None);
        }
        assert_eq!(Counts::of_closing_line("test a::b ... ok"), None);
    }

    #[test]
    fn a_skipped_test_is_not_counted_as_passed() {
        let counts = Counts { passed: 5, failed: 1, skipped: 1 }.of_which_skipped(2);
        assert_eq!(counts, Counts { passed: 3, failed: 1, skipped: 3 });
    }

    #[test]
    fn a_step_that_fails_stops_no_other_and_the_total_closes_the_table() {
        let mut summary = Summary::default();
        summary.step("lints", |_| anyhow::bail!("one warning"));
        summary.step("tests", |_| Ok(Counts { passed: 40, failed: 0, skipped: 2 }));
        assert_eq!(summary.total(), Counts { passed: 40, failed: 1, skipped: 2 });
        let shown = summary.to_string();
        let lines: Vec<&str> = shown.lines().collect();
        assert_eq!(lines[0], "lints: FAILED, one warning");
        assert_eq!(lines[1], "step   seconds   passed   failed  skipped");
        assert_eq!(lines[2], "lints        0        0        1        0");
        assert_eq!(lines[3], "tests        0       40        0        2");
        assert_eq!(lines[4], "40 passed, 1 failed, 2 skipped");
        assert_eq!(lines.len(), 5);
    }
}
