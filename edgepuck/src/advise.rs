//! `edgepuck advise`: recommends a configuration for a device, from measurements that are built in.

use crate::Outcome;
use crate::flags::{positive, probability};
use anyhow::{Result, bail};
use formats::interval::wilson;
use program::significant_digits::digits;
use serde::Deserialize;
use std::cmp::Ordering;
use std::fmt;
use std::io::Write;

/// The clouds that every setting of the record classified.
const TEST_SET: &str = "ModelNet40's test clouds, the half at hand";
/// What is said of the machine that is `here` in the record.
const MEASURED: &str = "\
    The times were measured on Intel(R) Xeon(R) Processor, 2 threads, linux x86_64.\n\
    `cargo build --release --package infer-cpu` builds infer-cpu as target/release/infer-cpu.\n";

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
#[command(group(clap::ArgGroup::new("limit").args(["max_ms", "min_accuracy"]).required(true).multiple(true)))]
pub struct AdviseArgs {
    /// Device that runs the classifier
    #[arg(long, value_enum)]
    device: Device,

    /// Longest acceptable time from a raw cloud to its class, milliseconds
    #[arg(long, value_name = "MS", value_parser = positive)]
    max_ms: Option<f64>,

    /// Lowest acceptable accuracy, from 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = probability)]
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
}

/// The setting in words.
impl fmt::Display for Measurement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { model, sampler, points, precision, .. } = self;
        write!(f, "{model}, {sampler} {points}, {precision}")?;
        write!(f, ", {} thread{}", self.threads, if self.threads == 1 { "" } else { "s" })
    }
}

/// The time on the device, milliseconds, and the row.
type Timed<'a> = (f64, &'a Measurement);

pub fn run(args: &AdviseArgs) -> Result<Outcome> {
    std::io::stdout().write_all(advise(args, &record())?.as_bytes())?;
    Ok(Outcome::Success)
}

fn record() -> Vec<Measurement> {
    let mut csv = csv::Reader::from_reader(edgepuck_assets::ADVISE_RECORD.as_bytes());
    let rows: Result<_, csv::Error> = csv.deserialize().collect();
    rows.expect("invariant: the record is built in")
}

/// The most accurate setting within the time or, with a limit on accuracy alone, the fastest one; of equal
/// ones, the one with fewer threads.
fn advise(args: &AdviseArgs, rows: &[Measurement]) -> Result<String> {
    let timed: Vec<Timed> =
        rows.iter().filter_map(|row| Some((row.ms(args.device)?, row))).collect();
    let is_allowed = |(ms, row): &&Timed| {
        args.max_ms.is_none_or(|most| *ms <= most)
            && args.min_accuracy.is_none_or(|least| row.accuracy() >= least)
    };
    let fitting: Vec<Timed> = timed.iter().filter(is_allowed).copied().collect();
    let better = |a: &&Timed, b: &&Timed| {
        let accuracy = a.1.accuracy().total_cmp(&b.1.accuracy());
        let speed = b.0.total_cmp(&a.0);
        let first = if args.max_ms.is_some() { accuracy.then(speed) } else { speed };
        first.then(accuracy).then(b.1.threads.cmp(&a.1.threads))
    };
    match fitting.iter().max_by(better) {
        Some(chosen) => Ok(report(args, chosen, &fitting, &timed)),
        None => bail!(nearest_of(&timed)),
    }
}

fn by_time(a: &&Timed, b: &&Timed) -> Ordering {
    a.0.total_cmp(&b.0)
}

/// What is said if no setting fits: the settings that come nearest.
fn nearest_of(timed: &[Timed]) -> String {
    let mut text = "no measured setting meets these limits".to_owned();
    let best = timed.iter().max_by(|a, b| a.1.accuracy().total_cmp(&b.1.accuracy()));
    for (what, nearest) in [("fastest", timed.iter().min_by(by_time)), ("most accurate", best)] {
        text += &nearest.map_or_else(String::new, |it| format!("\n  the {what}: {}", one_line(it)));
    }
    text
}

/// What is said of the `chosen` one of the `fitting` settings, which are some of the `timed` ones.
fn report(args: &AdviseArgs, chosen: &Timed, fitting: &[Timed], timed: &[Timed]) -> String {
    let why = match args.max_ms {
        Some(_) => "this is the most accurate of them, and the fastest of equally accurate ones.",
        None => "this is the fastest of them.",
    };
    let times = match args.device {
        Device::Pi5 => {
            "The times are modelled (`cargo xtask bench pi-model`); `infer-cpu bench` measures a board.\n\
             `cargo xtask build-pi` builds infer-cpu for the Raspberry Pi.\n"
        }
        Device::Here => MEASURED,
    };
    let (ms, row) = *chosen;
    let mut text = format!(
        "{}\n\n  {}\n\nWhy: of {} settings measured on {TEST_SET} ({} clouds), {} meet the limits; {why}\n{times}",
        one_line(chosen),
        command(row),
        timed.len(),
        row.clouds,
        fitting.len()
    );
    let (low, high) = wilson(row.right, row.clouds);
    // If the difference is not significant, a user may prefer the cheaper setting.
    let as_good = |it: &&Timed| it.0 < 0.75 * ms && it.1.accuracy() >= low;
    if let Some(cheaper) = fitting.iter().filter(as_good).min_by(by_time) {
        let lost = 100.0 * (row.accuracy() - cheaper.1.accuracy());
        let saved = 100.0 * (1.0 - cheaper.0 / ms);
        text += &format!(
            "A cheaper setting within the 95 % interval loses {lost:.1} points and saves {saved:.0} % of \
             the time:\n  {}\n",
            one_line(cheaper)
        );
    }
    let is_beyond = |it: &&Timed| it.1.accuracy() > high;
    if let Some(beyond) = timed.iter().filter(is_beyond).min_by(by_time) {
        let line = one_line(beyond);
        text += &format!(
            "A setting that is significantly more accurate, beyond the limits:\n  {line}\n"
        );
    }
    text
}

fn one_line((ms, row): &Timed) -> String {
    let (low, high) = wilson(row.right, row.clouds);
    let [share, low, high] = [row.accuracy(), low, high].map(|share| 100.0 * share);
    let (ms, megabytes) = (digits(*ms), digits(row.megabytes));
    format!("{row}: {ms} ms, {share:.2} % ({low:.2} to {high:.2}), {megabytes} MB of weights")
}

fn command(row: &Measurement) -> String {
    let Measurement { model, precision, points, threads, .. } = row;
    let sampler = row.sampler.replace(':', " --front ");
    format!(
        "infer-cpu classify --model {model} --sampler {sampler} --points {points} --precision \
         {precision} --threads {threads} CLOUD"
    )
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
    fn only_measured_settings_are_advised() {
        let error = advise(&asked(Some(0.1), None), &rows()).unwrap_err().to_string();
        assert!(error.contains("the fastest: small") && error.contains("most accurate: huge"));
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
