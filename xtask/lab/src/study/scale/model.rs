//! What a whole plan costs, computed from what one cloud costs.

use super::runs::Plan;
use crate::render::table::digits;

/// Cores of one machine, which runs one task.
pub const CORES: u64 = 4;
const CORES_PER_GPU: f64 = 16.0;
const MACHINES: [u64; 3] = [1, 64, 1000];

/// USD: half of an hour of m7g.large (2 vCPU, Linux, us-east-1) on demand, of 17 June 2026, from
/// <https://www.factualminds.com/blog/amazon-ec2-on-demand-pricing-instance-families-2026/>.
const VCPU_HOUR_USD: f64 = 0.0816 / 2.0;
/// S3 Standard in us-east-1: up to how many GiB, and USD for one of them and a month, of 7 July 2022,
/// from <https://gist.github.com/EverettBerry/a37438006529a55f42da6fdbc44a505c>.
const STORAGE_USD: [(f64, f64); 3] =
    [(50.0 * 1024.0, 0.023), (500.0 * 1024.0, 0.022), (f64::INFINITY, 0.021)];
/// USD for one PUT or POST to S3 Standard, of 24 March 2023, from
/// <https://gist.github.com/casouri/56e1e634e50d1ae023f3bb8ea4d053de>.
const REQUEST_USD: f64 = 0.005 / 1000.0;

/// Up to how large objects are uploaded whole, and in how large parts others are: rclone's defaults of
/// `--s3-upload-cutoff` and `--s3-chunk-size` (<https://rclone.org/s3/>), and the most of both.
const DEFAULT_PARTS: [u64; 2] = [200 << 20, 5 << 20];
const LARGEST_PARTS: [u64; 2] = [5 << 30, 5 << 30];

/// What one cloud costs.
pub struct PerCloud {
    pub cpu_s: f64,
    /// What a GPU may take of them.
    pub cast_cpu_s: f64,
    pub bytes: f64,
}

impl PerCloud {
    /// Cores that make as many bytes as a link of so many Gbit/s takes.
    pub fn cores_to_fill(&self, gigabits_per_s: f64) -> f64 {
        gigabits_per_s * 1e9 / 8.0 / (self.bytes / self.cpu_s)
    }
}

/// Clouds of the first of `parts` parts, which has the most.
fn most_clouds(plan: Plan, parts: u64) -> u64 {
    let of_split = |scans: u64| {
        let starts = (0..scans).step_by((plan.tar_clouds * parts) as usize);
        starts.map(|start| (scans - start).min(plan.tar_clouds)).sum::<u64>()
    };
    plan.splits().map(of_split).iter().sum()
}

/// Requests that upload an object: one; or one that begins, one for each part, and one that ends.
fn requests(bytes: u64, [cutoff, part]: [u64; 2]) -> u64 {
    if bytes <= cutoff { 1 } else { 2 + bytes.div_ceil(part) }
}

/// USD for keeping `bytes` for a month.
fn month_usd(bytes: f64) -> f64 {
    let (mut below, mut usd) = (0.0, 0.0);
    for (up_to, price) in STORAGE_USD {
        usd += ((bytes / f64::from(1 << 30)).min(up_to) - below).max(0.0) * price;
        below = up_to;
    }
    usd
}

/// The costs of `plan`, each with its name.
pub fn costs(plan: Plan, cloud: &PerCloud) -> Vec<(String, String)> {
    let (scans, tars) = (plan.scans as f64, plan.tars().iter().sum::<u64>());
    let (cpu_h, bytes) = (scans * cloud.cpu_s / 3600.0, scans * cloud.bytes);
    let left_h = cpu_h - scans * cloud.cast_cpu_s / 3600.0;
    let tar_bytes = (cloud.bytes * plan.tar_clouds as f64) as u64;
    let [many, few] = [DEFAULT_PARTS, LARGEST_PARTS].map(|parts| tars * requests(tar_bytes, parts));
    let parts = MACHINES[2].min(plan.tars()[0]);
    let (cast_usd, year_usd) = (cpu_h * VCPU_HOUR_USD, 12.0 * month_usd(bytes));
    let walls = MACHINES.map(|machines| {
        let cpu_s = most_clouds(plan, machines) as f64 * cloud.cpu_s;
        (format!("wall time, machines: {machines}"), time(cpu_s / CORES as f64))
    });
    let others = [
        ("CPU-hours", digits(cpu_h)),
        ("CPU-hours beside GPUs, at least", digits(left_h)),
        ("GPU-hours, a GPU for 16 cores, at least", digits(left_h / CORES_PER_GPU)),
        ("terabytes", digits(bytes / 1e12)),
        ("tars", tars.to_string()),
        ("files: tars, records, manifests of parts, list", (2 * tars + parts + 1).to_string()),
        ("requests, parts of 5 GiB", few.to_string()),
        ("requests, parts of 5 MiB", many.to_string()),
        ("USD to cast", digits(cast_usd)),
        ("USD for requests, parts of 5 GiB", digits(few as f64 * REQUEST_USD)),
        ("USD for requests, parts of 5 MiB", digits(many as f64 * REQUEST_USD)),
        ("USD to keep, a month", digits(year_usd / 12.0)),
        ("USD to keep, a year", digits(year_usd)),
        ("USD to keep, a year / to cast again", digits(year_usd / cast_usd)),
    ];
    walls.into_iter().chain(others.map(|(name, cost)| (name.to_owned(), cost))).collect()
}

fn time(s: f64) -> String {
    match s / 3600.0 {
        h if h < 1.0 => format!("{} min", digits(60.0 * h)),
        h if h < 100.0 => format!("{} h", digits(h)),
        h => format!("{} days", digits(h / 24.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: Plan = Plan { scans: 1_000_000, tar_clouds: 65_536 };

    #[test]
    fn the_first_part_has_the_most_clouds() {
        // Of 13 tars to train with, those numbered 0 and 8; of 4 to test with, that numbered 0.
        let found = [1, 8, 1000].map(|parts| most_clouds(PLAN, parts));
        assert_eq!(found, [1_000_000, 3 * 65_536, 2 * 65_536]);
    }

    #[test]
    fn a_plan_costs_what_its_clouds_do() {
        let cloud = PerCloud { cpu_s: 0.1, cast_cpu_s: 0.04, bytes: 1e4 };
        let found = costs(PLAN, &cloud);
        let cost = |name: &str| found.iter().find(|(n, _)| n.starts_with(name)).unwrap().1.as_str();
        assert_eq!([cost("CPU-hours"), cost("CPU-hours beside")], ["27.8", "16.7"]);
        // 17 tars and records, 13 manifests of parts, one list; a tar of 655 MB has 125 parts.
        assert_eq!([cost("files"), cost("requests, parts of 5 M")], ["48", "2159"]);
        assert_eq!([cost("requests"), cost("wall time, machines: 1")], ["17", "6.944 h"]);
        assert_eq!(cloud.cores_to_fill(1.0), 1250.0);
        let tiers = 50.0 * 0.023 + 450.0 * 0.022 + 500.0 * 0.021;
        assert!((month_usd(1000.0 * 2f64.powi(40)) - 1024.0 * tiers).abs() < 1e-6);
    }
}
