//! The record of `cargo xtask trade`: measured settings with their costs and accuracies.

use anyhow::{Context, Result, ensure};
use formats::atomic;
use formats::interval::wilson;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

/// The part of the pipeline that a row measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// From mesh to scan, with different sensors, distances and noise and the same classifier.
    #[default]
    Scan,
    /// From mesh to scan, with different casters.
    Caster,
    /// From cloud to class, with different classifiers.
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

/// A measured setting of all parameters. Fields that do not apply to its part are empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// The part of the pipeline.
    pub part: Part,
    /// The clouds of the measurement.
    pub test_set: String,
    /// The parameter that differs from the reference.
    pub knob: String,

    /// Name of the sensor's profile, or of a variant of it.
    pub sensor: String,
    /// Number of beams, one above another.
    pub beams: Option<usize>,
    /// Angle from one firing to the next.
    pub azimuth_step_deg: Option<f64>,
    /// Unit to which ranges are rounded. 0 if they are not rounded.
    pub range_quantum_m: Option<f64>,
    /// Distance from the sensor to the centre of the object, whose radius is 1 m.
    pub distance_m: Option<f64>,
    /// Standard deviation of the noise along the ray.
    pub noise_m: Option<f64>,
    /// The caster.
    pub caster: String,
    /// Whether beams that cannot hit the object are left out: on or off.
    pub culling: String,
    /// Name of the model.
    pub model: String,
    /// File of the model.
    pub model_file: String,
    /// The sampler.
    pub sampler: String,
    /// Number of points for the network.
    pub points: Option<usize>,
    /// Precision of the network.
    pub precision: String,
    /// The T-Nets that run. Empty if the model has no T-Net.
    pub t_nets: String,
    /// Number of threads of the classifier.
    pub threads: Option<usize>,

    /// Rays that the sensor fires per second of CPU time, including those that cannot hit.
    pub rays_per_cpu_s: Option<f64>,
    /// Scans per second of CPU time, from aiming to points.
    pub scans_per_cpu_s: Option<f64>,
    /// On this machine, the CPU time of a scan (wall time on a GPU), or the median wall time of a
    /// classification.
    pub ms_here: Option<f64>,
    /// Modelled time of a classification on a Raspberry Pi 5.
    pub ms_pi5: Option<f64>,
    /// Mean size of a scan's file, or size of the weights in the precision.
    pub megabytes: Option<f64>,

    /// Mean number of points of a scan.
    pub points_per_scan: Option<f64>,
    /// Root mean square difference between ranges and those in f64 without effects.
    pub range_rms_m: Option<f64>,
    /// Largest of these differences.
    pub range_worst_m: Option<f64>,
    /// Rays per million for which a hit in f64 is a miss here, or the reverse.
    pub wrong_rays_per_million: Option<f64>,
    /// Mean Chamfer distance (the sum of both directions) to the clean VLP-32C scan in f64 from the
    /// same place, over a sample of the scans that have points.
    pub chamfer_m: Option<f64>,
    /// Largest difference of a logit from that in f32 with the same sampler and number of points. A
    /// CPL chooses points in the row's precision, so that the points may differ.
    pub logit_error: Option<f64>,
    /// Share of clouds with the same answer as the reference: the reference scan, the f64 caster,
    /// or the network in f32 with all T-Nets, the same sampler and the same number of points.
    pub agreement: Option<f64>,
    /// Number of clouds that are classified correctly.
    pub right: usize,
    /// Number of clouds.
    pub clouds: usize,
    /// Share of clouds that are classified correctly.
    pub accuracy: f64,
    /// Lower end of the accuracy's 95 % interval (Wilson 1927).
    pub accuracy_low: f64,
    /// Upper end of that interval.
    pub accuracy_high: f64,
    /// The machine of the measurement.
    pub machine: String,
    /// Whether no other row of the same kind is both faster on this machine and more accurate.
    pub front_here: bool,
    /// Whether no other row of the same kind is both faster on a Raspberry Pi 5, by the model, and
    /// more accurate.
    pub front_pi5: bool,
}

impl Measurement {
    /// The row with the accuracy of `right` correct answers for `clouds` clouds.
    pub fn with_accuracy(mut self, right: usize, clouds: usize) -> Self {
        (self.right, self.clouds) = (right, clouds);
        self.accuracy = right as f64 / clouds.max(1) as f64;
        (self.accuracy_low, self.accuracy_high) = wilson(right, clouds);
        self
    }

    /// The row with the times of a scan that fires `rays` rays in `seconds` seconds of CPU time.
    pub fn with_time(mut self, rays: usize, seconds: f64) -> Self {
        self.rays_per_cpu_s = Some(rays as f64 / seconds);
        self.scans_per_cpu_s = Some(1.0 / seconds);
        self.ms_here = Some(seconds * 1e3);
        self
    }

    /// Time in milliseconds on `device`.
    pub fn ms(&self, device: Device) -> Option<f64> {
        match device {
            Device::Pi5 => self.ms_pi5,
            Device::Here => self.ms_here,
        }
    }

    /// Whether the row is on the Pareto front of `device`.
    pub fn on_front(&self, device: Device) -> bool {
        match device {
            Device::Pi5 => self.front_pi5,
            Device::Here => self.front_here,
        }
    }
}

/// The settings in words.
impl fmt::Display for Measurement {
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

/// Writes `rows` to `path` as CSV.
pub fn write(rows: &[Measurement], path: &Path) -> Result<()> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    for row in rows {
        csv.serialize(row)?;
    }
    Ok(atomic::write_bytes(path, &csv.into_inner()?)?)
}

/// The record that is part of this program.
pub fn bundled() -> Result<Vec<Measurement>> {
    parse(edgepuck_assets::TRADE_RECORD.as_bytes()).context("the built-in record")
}

/// Reads the record that [`write()`] wrote to `path`.
pub fn read(path: &Path) -> Result<Vec<Measurement>> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&bytes).with_context(|| path.display().to_string())
}

fn parse(bytes: &[u8]) -> Result<Vec<Measurement>> {
    let mut csv = csv::Reader::from_reader(bytes);
    let rows: Result<Vec<Measurement>, csv::Error> = csv.deserialize().collect();
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
        let scan = Measurement { noise_m: Some(0.01), ..Measurement::default() };
        let class = Measurement {
            part: Part::Classifier,
            model: "a, \"b\"".to_owned(),
            ..Measurement::default()
        };
        let rows = [scan.with_accuracy(9, 10), class.with_accuracy(0, 0)];
        write(&rows, &path).unwrap();
        assert_eq!(read(&path).unwrap(), rows);
    }

    #[test]
    fn a_line_that_is_no_row_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trade.csv");
        write(&[Measurement::default(), Measurement::default()], &path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap().replacen("\nscan,", "\nscam,", 1);
        std::fs::write(&path, text).unwrap();
        let error = format!("{:#}", read(&path).unwrap_err());
        assert!(error.contains("trade.csv") && error.contains("line: 2"), "{error}");
    }
}
