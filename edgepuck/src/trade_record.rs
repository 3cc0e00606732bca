//! One measured setting: what it is, what it costs, how right it is.

use anyhow::{Context, Result, ensure};
use formats::atomic;
use formats::interval::wilson;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

/// Which stretch of the chain a row is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// From mesh to scan, by sensor, place and noise; the classifier stays.
    #[default]
    Scan,
    /// The same by what casts.
    Caster,
    /// From cloud to class.
    Classifier,
}

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

/// One setting of all knobs. A field that a part does not have is empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The stretch of the chain.
    pub part: Part,
    /// The clouds on which it was measured.
    pub test_set: String,
    /// The knob that is turned, away from the reference.
    pub knob: String,

    /// Name of the sensor's profile, or what was made of it.
    pub sensor: String,
    /// Beams, one above the other.
    pub beams: Option<usize>,
    /// From one firing to the next.
    pub azimuth_step_deg: Option<f64>,
    /// Ranges are multiples of this; 0: they are not rounded.
    pub range_quantum_m: Option<f64>,
    /// From the sensor to the object's centre; the object's radius is 1 m.
    pub distance_m: Option<f64>,
    /// Standard deviation of the noise along the ray.
    pub noise_m: Option<f64>,
    /// What finds the hits and their ranges.
    pub caster: String,
    /// Whether beams that cannot hit are left out: on or off.
    pub culling: String,
    /// The model's name.
    pub model: String,
    /// Its file.
    pub model_file: String,
    /// How points are chosen.
    pub sampler: String,
    /// Points that the network sees.
    pub points: Option<usize>,
    /// What the network computes in.
    pub precision: String,
    /// T-Nets that are run; empty where the model has none.
    pub t_nets: String,
    /// Threads of the classifier.
    pub threads: Option<usize>,

    /// Rays that the sensor fires, those that cannot hit among them, a second of CPU time.
    pub rays_per_cpu_s: Option<f64>,
    /// Scans a second of CPU time, from aiming to points.
    pub scans_per_cpu_s: Option<f64>,
    /// CPU time of a scan (on a GPU wall time), or the median wall time of a classification, on
    /// this machine.
    pub ms_here: Option<f64>,
    /// Modelled time of a classification on a Raspberry Pi 5.
    pub ms_pi5: Option<f64>,
    /// Of a scan or a classification, where this machine's counters tell.
    pub joules: Option<f64>,
    /// File of a scan on average, or weights as the precision holds them.
    pub megabytes: Option<f64>,

    /// Points of a scan on average.
    pub points_per_scan: Option<f64>,
    /// Root of the mean square of ranges less those in f64 without any effect.
    pub range_rms_m: Option<f64>,
    /// The largest of these differences.
    pub range_worst_m: Option<f64>,
    /// Rays that hit where f64 does not, or miss where it hits, in a million that are fired.
    pub wrong_rays_per_million: Option<f64>,
    /// Mean distance to the clean VLP-32C scan (ranges in f64) from the same place, both ways
    /// added, of some of those scans that have points.
    pub chamfer_m: Option<f64>,
    /// Largest difference of a logit from f32's by the same sampler and number of points; a CPL
    /// chooses its points in the row's own precision, so they need not be the same ones.
    pub logit_error: Option<f64>,
    /// Share of clouds with the same answer as the reference's: the reference scan's, the f64
    /// caster's, or that of fp32 and all T-Nets by the same sampler and number of points.
    pub agreement: Option<f64>,
    /// Clouds classified as labelled.
    pub right: usize,
    /// Clouds.
    pub clouds: usize,
    /// Their share.
    pub accuracy: f64,
    /// Lower end of its 95 % interval (Wilson 1927).
    pub accuracy_low: f64,
    /// Upper end.
    pub accuracy_high: f64,
    /// What measured it.
    pub machine: String,
    /// Whether no other row of its kind costs less here and is better.
    pub front_here: bool,
    /// The same on a Raspberry Pi 5, modelled.
    pub front_pi5: bool,
}

impl Row {
    /// The row with `right` of `clouds` classified as labelled.
    #[must_use]
    pub fn with_accuracy(mut self, right: usize, clouds: usize) -> Self {
        (self.right, self.clouds) = (right, clouds);
        self.accuracy = right as f64 / clouds.max(1) as f64;
        (self.accuracy_low, self.accuracy_high) = wilson(right, clouds);
        self
    }

    /// The row with the CPU time of a scan of so many `rays`.
    #[must_use]
    pub fn with_time(mut self, rays: usize, seconds: f64) -> Self {
        self.rays_per_cpu_s = Some(rays as f64 / seconds);
        self.scans_per_cpu_s = Some(1.0 / seconds);
        self.ms_here = Some(seconds * 1e3);
        self
    }

    /// Milliseconds on `device`.
    #[must_use]
    pub fn ms(&self, device: Device) -> Option<f64> {
        match device {
            Device::Pi5 => self.ms_pi5,
            Device::Here => self.ms_here,
        }
    }

    /// Whether it is on the front of `device`.
    #[must_use]
    pub fn on_front(&self, device: Device) -> bool {
        match device {
            Device::Pi5 => self.front_pi5,
            Device::Here => self.front_here,
        }
    }
}

/// The settings in words.
impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut words: Vec<String> = Vec::new();
        match self.part {
            Part::Classifier => {
                let points = self.points.unwrap_or_default();
                words
                    .push(format!("{}, {} {points}, {}", self.model, self.sampler, self.precision));
                if !self.t_nets.is_empty() {
                    words.push(format!("T-Nets {}", self.t_nets));
                }
                words.extend(self.threads.map(|threads| match threads {
                    1 => "1 thread".to_owned(),
                    _ => format!("{threads} threads"),
                }));
            }
            Part::Caster => words.push(format!("{}, culling {}", self.caster, self.culling)),
            Part::Scan => {
                words.push(self.sensor.clone());
                words.extend(self.azimuth_step_deg.map(|step| format!("{step:.2}° steps")));
                words.extend(self.distance_m.map(|m| format!("{m} m away")));
                words.extend(self.noise_m.map(|m| format!("noise {m} m")));
                words.extend(self.range_quantum_m.map(|m| format!("quantum {m} m")));
            }
        }
        f.write_str(&words.join(", "))
    }
}

/// Writes `rows` as CSV.
///
/// # Errors
/// What the system reports.
pub fn write(rows: &[Row], path: &Path) -> Result<()> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    for row in rows {
        csv.serialize(row)?;
    }
    Ok(atomic::write_bytes(path, &csv.into_inner()?)?)
}

/// The record that ships with this program.
///
/// # Errors
/// The record does not hold a row of these columns.
pub fn bundled() -> Result<Vec<Row>> {
    parse(edgepuck_assets::TRADE_RECORD.as_bytes()).context("the record that ships")
}

/// Reads what [`write()`] wrote.
///
/// # Errors
/// Names the file, and the line that is not as it should be.
pub fn read(path: &Path) -> Result<Vec<Row>> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&bytes).with_context(|| path.display().to_string())
}

fn parse(bytes: &[u8]) -> Result<Vec<Row>> {
    let mut csv = csv::Reader::from_reader(bytes);
    let rows: Result<Vec<Row>, csv::Error> = csv.deserialize().collect();
    let rows = rows.context("expected a record of `cargo xtask trade`")?;
    ensure!(!rows.is_empty(), "expected a record of `cargo xtask trade`, found no rows");
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_survive_a_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trade.csv");
        let scan = Row { noise_m: Some(0.01), joules: None, ..Row::default() };
        let class = Row { part: Part::Classifier, model: "a, \"b\"".to_owned(), ..Row::default() };
        let rows = [scan.with_accuracy(9, 10), class.with_accuracy(0, 0)];
        write(&rows, &path).unwrap();
        assert_eq!(read(&path).unwrap(), rows);
    }

    #[test]
    fn a_line_that_is_no_row_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trade.csv");
        write(&[Row::default(), Row::default()], &path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap().replacen("\nscan,", "\nscam,", 1);
        std::fs::write(&path, text).unwrap();
        let error = format!("{:#}", read(&path).unwrap_err());
        assert!(error.contains("trade.csv") && error.contains("line: 2"), "{error}");
    }
}
