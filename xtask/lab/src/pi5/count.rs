//! Instructions of one classification, counted by function under QEMU.

use super::kernels::{Kernels, Number, demangled};
use super::model::{Other, load, tile_instructions};
use super::plan::{Setting, Stage};
use anyhow::{Context, ensure};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use xtask::{pi_target, workspace};

/// The plugin's source, from the workspace's root.
const SOURCE: &str = "xtask/lab/peers/insn_count.c";

pub struct Counter {
    plugin: PathBuf,
    folder: PathBuf,
    binary: PathBuf,
    model: PathBuf,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Counts(BTreeMap<String, f64>);

impl Counter {
    /// Builds QEMU's plugin in `folder`, and tries it on `binary`. Needs a C compiler and an
    /// emulator that takes plugins.
    pub fn new(folder: &Path, binary: &Path, model: &Path) -> anyhow::Result<Self> {
        let plugin = folder.join("insn_count.so");
        let mut cc = Command::new("cc");
        cc.args(["-O2", "-shared", "-fPIC", "-o"]).arg(&plugin).arg(workspace::root().join(SOURCE));
        workspace::output(&mut cc).context("the plugin that counts needs a C compiler")?;
        let (binary, model) = (binary.to_owned(), model.to_owned());
        let counter = Self { plugin, folder: folder.to_owned(), binary, model };
        counter.run("--version", &[]).context("this QEMU takes no plugins (7.2 does)")?;
        Ok(counter)
    }

    pub fn classification(&self, setting: Setting) -> anyhow::Result<Counts> {
        let Setting { sampler, from, points, precision } = setting;
        let sampler = sampler.word();
        eprintln!("counting {sampler} {points} of {from} in {precision}");
        let repeated = |repeats: usize| {
            let flags = format!(
                "bench --json --threads 1 --repeats {repeats} --sampler {sampler} --from {from} \
                 --points {points} --precision {precision} --model"
            );
            self.run(&flags, &[&self.model])
        };
        Ok(repeated(2)?.less(&repeated(1)?))
    }

    /// Counts a run of the binary with these flags, then `more`.
    fn run(&self, flags: &str, more: &[&Path]) -> anyhow::Result<Counts> {
        let mut qemu = pi_target::emulator().context(pi_target::NO_EMULATOR)?;
        let log = tempfile::NamedTempFile::new_in(&self.folder)?;
        qemu.arg("-plugin").arg(&self.plugin).args(["-d", "plugin", "-D"]).arg(log.path());
        workspace::output(qemu.arg(&self.binary).args(flags.split(' ')).args(more))?;
        let log = std::fs::read_to_string(log.path())
            .with_context(|| format!("cannot read {}", log.path().display()))?;
        let counts = Counts::parse(&log);
        ensure!(!counts.0.is_empty(), "QEMU's plugin counted nothing");
        Ok(counts)
    }
}

impl Counts {
    pub fn parse(log: &str) -> Self {
        let mut counts = BTreeMap::new();
        for (count, symbol) in log.lines().filter_map(|line| line.split_once(' ')) {
            let Ok(count) = count.parse::<f64>() else { continue };
            *counts.entry(demangled(symbol)).or_default() += count;
        }
        Self(counts)
    }

    fn less(&self, other: &Self) -> Self {
        let before = |name| other.0.get(name).copied().unwrap_or(0.0);
        Self(self.0.iter().map(|(name, count)| (name.clone(), count - before(name))).collect())
    }

    fn of(&self, part: &str) -> f64 {
        self.0.iter().filter(|(name, _)| name.contains(part)).map(|(_, count)| count).sum()
    }

    /// The instructions outside the inner loops of `stages`, and the share of the vector layers'
    /// columns that were read, the others' inputs being 0. Fails if a kernel has fewer instructions
    /// than the plan has in its loops: the binary did something else.
    pub fn outside_loops(
        &self,
        stages: &[Stage],
        kernels: &Kernels,
    ) -> anyhow::Result<(Other, f64)> {
        let mut other = Other::default();
        for number in Number::ALL {
            let counted = self.of(number.tile_prefix());
            let planned = tile_instructions(stages, kernels, number);
            // Most instructions of a first layer's tiles are outside their loop.
            ensure!(
                planned <= counted && counted <= 10.0 * planned,
                "{counted} instructions were counted in {}…, {planned} are planned for its loop",
                number.tile_prefix()
            );
            other.shared += counted - planned;
        }
        let loops = |wanted: fn(&Stage) -> bool| {
            let stages = stages.iter().filter(move |stage| wanted(stage));
            stages.map(|stage| load(stage, kernels, 1).instructions).sum::<f64>()
        };
        let columns = loops(|stage| matches!(stage, Stage::Vector { .. }));
        let columns_read = (self.of("gemv::gemv") / columns).min(1.0);
        let farthest = loops(|stage| matches!(stage, Stage::Farthest { .. }));
        other.alone += (self.of("fps::step") - farthest).max(0.0);
        for (name, count) in self.0.iter().filter(|(name, _)| !is_kernel(name)) {
            let place = if is_shared(name) { &mut other.shared } else { &mut other.alone };
            *place += count;
        }
        Ok((other, columns_read))
    }
}

/// Whether the function is a kernel with a loop of its own.
fn is_kernel(name: &str) -> bool {
    let tiles = Number::ALL.map(Number::tile_prefix);
    ["gemv::gemv", "fps::step"].iter().chain(&tiles).any(|part| name.contains(part))
}

/// Whether the function runs on all threads instead of the caller's alone.
fn is_shared(name: &str) -> bool {
    let parts = [
        "edgepuck_kernels::",
        "engine::chunks",
        "PoolInput::lift",
        "PoolInput::pool",
        "::set_block",
    ];
    matches!(name, "memcpy" | "memset") || parts.iter().any(|part| name.contains(part))
}

#[cfg(test)]
mod tests {
    use super::super::kernels::tests::round_kernels;
    use super::super::network::Layer;
    use super::super::plan::Product;
    use super::*;

    fn counts(lines: &[(&str, f64)]) -> Counts {
        Counts(lines.iter().map(|&(name, count)| (name.to_owned(), count)).collect())
    }

    #[test]
    fn reads_and_subtracts_by_function() {
        let log = "100 _ZN1a1b17h0123456789abcdefE\n5 ?\n20 _ZN1a1b17hfedcba9876543210E\nqemu: x\n";
        let found = Counts::parse(log);
        assert_eq!(found, counts(&[("?", 5.0), ("a::b", 120.0)]));
        let less = found.less(&counts(&[("a::b", 20.0)]));
        assert_eq!(less.of("a::b"), 100.0);
    }

    /// One tile row of 8 x 64 channels and 4 inputs has 8 x 4 rounds of two
    /// instructions; 64 inputs of one block 64 rounds.
    #[test]
    fn what_no_loop_explains_is_other_work() {
        let layer = Layer { inputs: 4, outputs: 64 };
        let product = Product { layer, number: Number::F32 };
        let vector = Layer { inputs: 64, outputs: 10 };
        let stages = [
            Stage::Pool { rows: 8, product, screened: false },
            Stage::Vector { layer: vector, stored: Number::I8 },
        ];
        let mut lines = vec![
            ("edgepuck_kernels::neon::tile_f32_8x8", 100.0),
            ("edgepuck_kernels::neon::gemv::gemv", 96.0),
            ("edgepuck_kernels::neon::tile::max", 7.0),
            ("infer_cpu::normalize::to_unit_sphere", 30.0),
        ];
        let (other, columns_read) =
            counts(&lines).outside_loops(&stages, &round_kernels()).unwrap();
        assert_eq!(other, Other { shared: 36.0 + 7.0, alone: 30.0 });
        assert_eq!(columns_read, 0.75);
        lines[0].1 = 63.0;
        let error = counts(&lines).outside_loops(&stages, &round_kernels()).unwrap_err();
        assert!(error.to_string().contains("63 instructions were counted"), "{error}");
    }
}
