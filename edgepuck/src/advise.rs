//! `edgepuck advise`: recommends a configuration for a device, from measurements that are built in.

use crate::flags::positive;
use crate::significant_digits::digits;
use crate::{Outcome, Usage};
use anyhow::{Result, bail};
use formats::interval::wilson;
use serde::Deserialize;
use std::cmp::Ordering;
use std::fmt;
use std::fmt::Write as _;
use std::io::Write as _;

/// The clouds that every setting of the record classified.
const TEST_SET: &str = "ModelNet40's test clouds, the half at hand";
/// The machine that is `here` in the record.
const MACHINE: &str = "Intel(R) Xeon(R) Processor, 2 threads, linux x86_64";

formats::named! {
    /// A device that was measured or modelled.
    #[derive(clap::ValueEnum)]
    pub enum Device: "device" {
        /// A Raspberry Pi 5; its times are modelled.
        Pi5 = "pi5",
        /// The machine on which the record was measured.
        Here = "here",
    }
}

#[derive(clap::Args)]
pub struct AdviseArgs {
    /// Device that runs the classifier
    #[arg(long, value_enum)]
    device: Device,

    /// Longest acceptable time from a raw cloud to its class, milliseconds
    #[arg(long, value_name = "MS", value_parser = positive)]
    max_ms: Option<f64>,

    /// Lowest acceptable accuracy, from 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = share)]
    min_accuracy: Option<f64>,
}

/// A line of the record: a setting that classified `clouds` clouds, `right` of them correctly.
#[derive(Clone, Deserialize)]
struct Measurement {
    model: String,
    /// The sampler, and after a colon the front end of `cpl`.
    sampler: String,
    points: usize,
    precision: String,
    threads: usize,
    /// `None` for numbers of threads that the machine lacks.
    ms_here: Option<f64>,
    /// `None` for samplers that are not modelled.
    ms_pi5: Option<f64>,
    /// Size of the weights in the precision.
    megabytes: f64,
    right: usize,
    clouds: usize,
}

impl Measurement {
    fn ms(&self, device: Device) -> Option<f64> {
        match device {
            Device::Pi5 => self.ms_pi5,
            Device::Here => self.ms_here,
        }
    }

    fn accuracy(&self) -> f64 {
        self.right as f64 / self.clouds as f64
    }

    /// The 95 % interval of the accuracy.
    fn interval(&self) -> (f64, f64) {
        wilson(self.right, self.clouds)
    }
}

/// The setting in words.
impl fmt::Display for Measurement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { model, sampler, points, precision, .. } = self;
        write!(f, "{model}, {sampler} {points}, {precision}")?;
        write!(f, ", {} thread{}", self.threads, if self.threads == 1 { "" } else { "s" })
    }
}

/// The time on the device, and the row.
type Timed<'a> = (f64, &'a Measurement);

pub fn run(args: &AdviseArgs) -> Result<Outcome> {
    args.check()?;
    let advice = advise(args, &record())?;
    std::io::stdout().write_all(advice.as_bytes())?;
    Ok(Outcome::Success)
}

fn record() -> Vec<Measurement> {
    let mut csv = csv::Reader::from_reader(edgepuck_assets::ADVISE_RECORD.as_bytes());
    let rows: Result<_, csv::Error> = csv.deserialize().collect();
    rows.expect("invariant: the record is built in")
}

fn advise(args: &AdviseArgs, rows: &[Measurement]) -> Result<String> {
    let timed: Vec<Timed> =
        rows.iter().filter_map(|row| Some((row.ms(args.device)?, row))).collect();
    let fitting: Vec<Timed> = timed.iter().copied().filter(|timed| args.allow(timed)).collect();
    let Some(&chosen) = fitting.iter().max_by(|a, b| args.compare(a, b)) else {
        bail!("{}", none_fits(&timed));
    };
    Ok(args.text(chosen, &fitting, &timed))
}

impl AdviseArgs {
    fn check(&self) -> Result<()> {
        if self.max_ms.is_none() && self.min_accuracy.is_none() {
            let cause = "expected at least one limit: --max-ms or --min-accuracy";
            return Err(Usage(cause.to_owned()).into());
        }
        Ok(())
    }

    /// Whether accuracy counts before time. With a limit on accuracy alone, time counts first.
    fn accuracy_first(&self) -> bool {
        self.max_ms.is_some()
    }

    fn allow(&self, &(ms, row): &Timed) -> bool {
        self.max_ms.is_none_or(|most| ms <= most)
            && self.min_accuracy.is_none_or(|least| row.accuracy() >= least)
    }

    /// Orders settings so that the better one is greater; of equal ones, the one with fewer
    /// threads.
    fn compare(&self, a: &Timed, b: &Timed) -> Ordering {
        let accuracy = a.1.accuracy().total_cmp(&b.1.accuracy());
        let speed = b.0.total_cmp(&a.0);
        let first = if self.accuracy_first() { accuracy.then(speed) } else { speed.then(accuracy) };
        first.then(b.1.threads.cmp(&a.1.threads))
    }

    fn text(&self, chosen: Timed, fitting: &[Timed], timed: &[Timed]) -> String {
        let (ms, row) = chosen;
        let mut text = format!("{}\n\n  {}\n", one_line(chosen), command(row));
        let _ = write!(
            text,
            "\nWhy: of {} settings measured on {TEST_SET} ({} clouds), {} meet the limits; ",
            timed.len(),
            row.clouds,
            fitting.len()
        );
        text += match self.accuracy_first() {
            true => {
                "this is the most accurate of them, and the fastest of equally accurate ones.\n"
            }
            false => "this is the fastest of them.\n",
        };
        text += &match self.device {
            Device::Pi5 => "The times are modelled (`cargo xtask bench pi-model`); `infer-cpu \
                            bench` measures a board.\n`cargo xtask build-pi` builds infer-cpu \
                            for the Raspberry Pi.\n"
                .to_owned(),
            Device::Here => format!(
                "The times were measured on {MACHINE}.\n`cargo build --release --package infer-cpu` \
                 builds infer-cpu as target/release/infer-cpu.\n"
            ),
        };
        let (low, high) = row.interval();
        // If the difference is not significant, a user may prefer the cheaper setting.
        let as_good =
            |&&(other_ms, other): &&Timed| other_ms < 0.75 * ms && other.accuracy() >= low;
        if let Some(&cheaper) = fitting.iter().filter(as_good).min_by(|a, b| a.0.total_cmp(&b.0)) {
            let lost = 100.0 * (row.accuracy() - cheaper.1.accuracy());
            let saved = 100.0 * (1.0 - cheaper.0 / ms);
            let _ = writeln!(
                text,
                "A cheaper setting within the 95 % interval loses {lost:.1} points and saves {saved:.0} % of the time:\n  {}",
                one_line(cheaper)
            );
        }
        let better = |&&(_, other): &&Timed| other.accuracy() > high;
        if let Some(&better) = timed.iter().filter(better).min_by(|a, b| a.0.total_cmp(&b.0)) {
            let _ = writeln!(
                text,
                "A setting that is significantly more accurate, beyond the limits:\n  {}",
                one_line(better)
            );
        }
        text
    }
}

/// The message if no setting meets the limits: it names the nearest ones.
fn none_fits(timed: &[Timed]) -> String {
    let mut text = "no measured setting meets these limits".to_owned();
    let fastest = timed.iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let best = timed.iter().max_by(|a, b| a.1.accuracy().total_cmp(&b.1.accuracy()));
    for (what, timed) in [("fastest", fastest), ("most accurate", best)] {
        if let Some(timed) = timed {
            let _ = write!(text, "\n  the {what}: {}", one_line(*timed));
        }
    }
    text
}

fn one_line((ms, row): Timed) -> String {
    let (low, high) = row.interval();
    format!(
        "{row}: {} ms, {:.2} % ({:.2} to {:.2}), {} MB of weights",
        digits(ms),
        100.0 * row.accuracy(),
        100.0 * low,
        100.0 * high,
        digits(row.megabytes),
    )
}

fn command(row: &Measurement) -> String {
    let Measurement { model, precision, points, threads, .. } = row;
    let mut words = format!("infer-cpu classify --model {model}");
    let mut sampler = row.sampler.split(':');
    let _ = write!(words, " --sampler {}", sampler.next().unwrap_or_default());
    if let Some(front) = sampler.next() {
        let _ = write!(words, " --front {front}");
    }
    let _ = write!(words, " --points {points} --precision {precision} --threads {threads} CLOUD");
    words
}

fn share(word: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("expected a share from 0 to 1, such as 0.85".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use infer_cpu::Precision;
    use infer_cpu::sampler::{FrontChoice, SamplerKind};

    fn row(model: &str, ms_pi5: f64, right: usize, threads: usize) -> Measurement {
        Measurement {
            model: model.to_owned(),
            sampler: "fps".to_owned(),
            points: 64,
            precision: "f32".to_owned(),
            threads,
            ms_here: None,
            ms_pi5: Some(ms_pi5),
            megabytes: 2.0,
            right,
            clouds: 1000,
        }
    }

    fn rows() -> Vec<Measurement> {
        vec![
            row("small", 0.3, 850, 4),
            row("middle", 0.6, 895, 4),
            row("large", 1.0, 900, 4),
            row("huge", 9.0, 950, 4),
            row("large", 1.0, 900, 1),
        ]
    }

    fn asked(max_ms: Option<f64>, min_accuracy: Option<f64>) -> AdviseArgs {
        AdviseArgs { device: Device::Pi5, max_ms, min_accuracy }
    }

    #[test]
    fn the_most_accurate_within_the_time_or_the_fastest_that_is_accurate_enough_is_advised() {
        let advice = advise(&asked(None, Some(0.89)), &rows()).unwrap();
        assert!(advice.starts_with("middle"), "{advice}");
        let advice = advise(&asked(Some(5.0), None), &rows()).unwrap();
        assert!(advice.starts_with("large"), "{advice}");
        assert!(advice.contains("1 thread:"), "of equals fewer threads: {advice}");
        assert!(advice.contains("loses 0.5 points and saves 40 % of the time"), "{advice}");
        assert!(
            advice.contains("significantly more accurate, beyond the limits:\n  huge"),
            "{advice}"
        );
    }

    #[test]
    fn a_configuration_is_a_command_line() {
        let row = Measurement { sampler: "cpl:own".to_owned(), ..row("m", 1.0, 1, 2) };
        let row = Measurement { precision: "i8".to_owned(), ..row };
        assert_eq!(
            command(&row),
            "infer-cpu classify --model m --sampler cpl --front own \
             --points 64 --precision i8 --threads 2 CLOUD"
        );
    }

    #[test]
    fn what_was_not_measured_is_not_advised() {
        let error = advise(&asked(Some(0.1), None), &rows()).unwrap_err().to_string();
        assert!(error.contains("the fastest: small") && error.contains("most accurate: huge"));
        assert!(asked(None, None).check().unwrap_err().is::<Usage>());
    }

    #[test]
    fn every_setting_of_the_record_is_one_of_infer_cpu() {
        for row in record() {
            let mut words = row.sampler.split(':');
            assert!(words.next().unwrap().parse::<SamplerKind>().is_ok(), "{row}");
            assert!(words.next().is_none_or(|front| front.parse::<FrontChoice>().is_ok()), "{row}");
            assert!(row.precision.parse::<Precision>().is_ok(), "{row}");
        }
    }
}
