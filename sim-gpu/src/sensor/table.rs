//! Directions in a table, as makers of scanners without a formula publish them.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{MAX_RAYS, MAX_RINGS, Rays, checked_ray_count};
use crate::config::{ConfigError, InvalidValue, positive, within};

/// The directions of successive beams, repeated when the table ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// A CSV file, relative to the profile, with the columns `azimuth_deg` and `elevation_deg`, or
    /// with Livox's `Azimuth/deg` and `Zenith/deg`, each once; other columns are ignored. Loading a sensor
    /// moves the rows to `directions_deg`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Rows per second.
    pub pulse_hz: f64,
    /// The duration of a scan, seconds.
    pub period_s: f64,
    /// The start of the first scan, seconds after the first row.
    #[serde(default)]
    pub start_s: f64,
    /// Laser lines, which take turns row by row; a point's ring is the index of its line.
    #[serde(default = "one_line")]
    pub lines: u16,
    /// Azimuth, counterclockwise from forward, and elevation of each row, instead of a file.
    #[serde(default)]
    pub directions_deg: Vec<[f64; 2]>,
}

/// The directions that a table can have.
const AZIMUTHS_DEG: RangeInclusive<f64> = -360.0..=360.0;
const ELEVATIONS_DEG: RangeInclusive<f64> = -90.0..=90.0;

fn one_line() -> u16 {
    1
}

impl Table {
    /// Reads the CSV file, if there is one, relative to the `profile`.
    pub(super) fn load(&mut self, profile: &Path) -> Result<(), InvalidValue> {
        if let Some(file) = self.file.take() {
            if !self.directions_deg.is_empty() {
                let cause = "cannot stand beside table.directions_deg";
                return Err(InvalidValue::new("table.file", cause));
            }
            let folder = profile.parent().unwrap_or(Path::new(""));
            self.directions_deg = read(&folder.join(file))
                .map_err(|error| InvalidValue::new("table.file", error.to_string()))?;
        }
        Ok(())
    }

    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        if let Some(file) = &self.file {
            let cause = format!("expected a profile in a file, to find {} by", file.display());
            return Err(InvalidValue::new("table.file", cause));
        }
        positive("table.pulse_hz", self.pulse_hz)?;
        within("table.pulse_hz", self.pulse_hz, 0.0..=1e9)?;
        positive("table.period_s", self.period_s)?;
        within("table.start_s", self.start_s, 0.0..=1e6)?;
        within("table.lines", f64::from(self.lines), 1.0..=MAX_RINGS)?;
        if self.directions_deg.is_empty() {
            let cause = "expected a row at least, or table.file, found none";
            return Err(InvalidValue::new("table.directions_deg", cause));
        }
        for (i, [azimuth_deg, elevation_deg]) in self.directions_deg.iter().enumerate() {
            let key = |column: u8| format!("table.directions_deg[{i}][{column}]");
            within(&key(0), *azimuth_deg, AZIMUTHS_DEG)?;
            within(&key(1), *elevation_deg, ELEVATIONS_DEG)?;
        }
        let (rows, lines) = (self.directions_deg.len(), self.lines);
        if !rows.is_multiple_of(lines.into()) {
            let cause = format!("expected rows of {lines} lines in turn, found {rows} rows");
            return Err(InvalidValue::new("table.lines", cause));
        }
        checked_ray_count("table", self.rays_in(1))
    }

    pub(super) fn rays_in(&self, scans: u32) -> u64 {
        self.rows(scans)
    }

    fn rows(&self, scans: u32) -> u64 {
        // The conversion to an integer saturates.
        (self.pulse_hz * self.period_s * f64::from(scans)).round() as u64
    }

    /// The row of the table for row number `row` of the scan.
    fn place(&self, row: u64) -> usize {
        let start = (self.start_s * self.pulse_hz).round() as u64;
        ((start + row) % self.directions_deg.len() as u64) as usize
    }

    pub(super) fn trim(&mut self, scans: u32) {
        let needed = self.rows(scans);
        let in_turn = u64::from(self.lines);
        if needed < self.directions_deg.len() as u64
            && (self.place(0) as u64).is_multiple_of(in_turn)
        {
            self.directions_deg =
                (0..needed).map(|row| self.directions_deg[self.place(row)]).collect();
            self.start_s = 0.0;
        }
    }

    pub(super) fn rays(&self, keep_each: u32, scans: u32) -> Rays {
        let rows = self.rows(scans);
        let mut rays = Rays::with_capacity(rows.div_ceil(u64::from(keep_each)) as usize);
        let in_turn = u64::from(self.lines);
        // All lines of a turn are kept, or none.
        for row in (0..rows).filter(|row| (row / in_turn).is_multiple_of(keep_each.into())) {
            let place = self.place(row);
            let [azimuth_rad, elevation_rad] = self.directions_deg[place].map(f64::to_radians);
            let (sin_azimuth, cos_azimuth) = libm::sincos(azimuth_rad);
            let (sine, cosine) = libm::sincos(elevation_rad);
            let direction = DVec3::new(cosine * cos_azimuth, cosine * sin_azimuth, sine);
            let line = place % usize::from(self.lines);
            rays.push(direction, line as u16, row as f64 / self.pulse_hz);
        }
        rays
    }
}

fn read(file: &Path) -> Result<Vec<[f64; 2]>, ConfigError> {
    let failed = |line: u64, cause: String| {
        let message = if line > 0 { format!("line {line}: {cause}") } else { cause };
        ConfigError::Content { file: file.to_owned(), message }
    };
    let opened = std::fs::File::open(file)
        .map_err(|source| ConfigError::Read { file: file.to_owned(), source })?;
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(opened);
    let line_of = |error: &csv::Error| error.position().map_or(0, csv::Position::line);
    let heading =
        csv.headers().map_err(|error| failed(line_of(&error), error.to_string()))?.clone();
    // The whole name, because it has the unit: `azimuth_rad` is another one.
    let column = |name: &str| -> Result<Option<usize>, ConfigError> {
        let is_it = |found: &str| {
            let found = found.to_ascii_lowercase();
            matches!(found.strip_prefix(name), Some("_deg" | "/deg"))
        };
        let mut places = (0..heading.len()).filter(|&at| is_it(&heading[at]));
        match (places.next(), places.next()) {
            (Some(_), Some(again)) => Err(failed(
                1,
                format!("expected one column of {name}, found {} too", &heading[again]),
            )),
            (place, _) => Ok(place),
        }
    };
    let missing = |name: &str| {
        let found = heading.iter().collect::<Vec<_>>().join(",");
        failed(1, format!("expected a column {name} between commas, found \"{found}\""))
    };
    let azimuth = column("azimuth")?.ok_or_else(|| missing("azimuth_deg"))?;
    let (upright, is_zenith) = match (column("elevation")?, column("zenith")?) {
        (Some(column), _) => (column, false),
        (None, Some(column)) => (column, true),
        (None, None) => return Err(missing("elevation_deg")),
    };
    let mut directions_deg = Vec::new();
    for record in csv.records() {
        let record = record.map_err(|error| failed(line_of(&error), error.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |column: usize| {
            let word = &record[column];
            let found = word.parse::<f64>().ok().filter(|x| x.is_finite());
            found.ok_or_else(|| failed(line, format!("expected a number, found \"{word}\"")))
        };
        let within = |name: &str, found: f64, range: RangeInclusive<f64>| {
            within(name, found, range).map_err(|error| failed(line, error.to_string()))
        };
        let (azimuth_deg, upright_deg) = (number(azimuth)?, number(upright)?);
        within(&heading[azimuth], azimuth_deg, AZIMUTHS_DEG)?;
        let elevation_deg = match is_zenith {
            true => {
                within(&heading[upright], upright_deg, 0.0..=180.0)?;
                90.0 - upright_deg
            }
            false => {
                within(&heading[upright], upright_deg, ELEVATIONS_DEG)?;
                upright_deg
            }
        };
        directions_deg.push([azimuth_deg, elevation_deg]);
        if directions_deg.len() as u64 > MAX_RAYS {
            return Err(failed(line, format!("expected at most {MAX_RAYS} rows, found more")));
        }
    }
    Ok(directions_deg)
}
