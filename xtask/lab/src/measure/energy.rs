//! Joules, where the machine counts them.

use std::fs;
use std::path::PathBuf;

/// The energy counters of the processor's packages (Linux powercap, RAPL).
pub struct Energy {
    packages: Vec<Package>,
}

struct Package {
    counter: PathBuf,
    wraps_at_uj: u64,
}

impl Energy {
    /// The counters that can be read; `None` if there are none, as in most
    /// virtual machines.
    pub fn here() -> Option<Self> {
        let zones = fs::read_dir("/sys/class/powercap").ok()?;
        let package = |zone: fs::DirEntry| {
            let name = zone.file_name().into_string().ok()?;
            // `intel-rapl:0` is a package, `intel-rapl:0:1` a part of it.
            if !name.starts_with("intel-rapl:") || name.matches(':').count() != 1 {
                return None;
            }
            let counter = zone.path().join("energy_uj");
            let wraps_at_uj = number(&zone.path().join("max_energy_range_uj"))?;
            number(&counter)?;
            Some(Package { counter, wraps_at_uj })
        };
        let packages: Vec<Package> = zones.flatten().filter_map(package).collect();
        (!packages.is_empty()).then_some(Self { packages })
    }

    /// What the counters say now, one a package, microjoules.
    pub fn now(&self) -> Vec<u64> {
        self.packages.iter().map(|package| number(&package.counter).unwrap_or_default()).collect()
    }

    /// Joules of all packages since `then`, of everything that ran.
    pub fn joules_since(&self, then: &[u64]) -> f64 {
        let all = self.packages.iter().zip(then.iter().zip(self.now()));
        let spent = all.map(|(package, (&then, now))| since(then, now, package.wraps_at_uj));
        spent.sum::<u64>() as f64 * 1e-6
    }
}

/// A counter that starts anew at `wraps_at` at most once.
fn since(then: u64, now: u64, wraps_at: u64) -> u64 {
    if now >= then { now - then } else { wraps_at.saturating_sub(then) + now }
}

fn number(path: &std::path::Path) -> Option<u64> {
    fs::read_to_string(path).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::since;

    #[test]
    fn a_counter_may_wrap() {
        assert_eq!(since(5, 9, 100), 4);
        assert_eq!(since(95, 3, 100), 8);
    }
}
