//! Sensors: the directions and firing times of beams, and the ranges that they measure.
//!
//! A sensor is a TOML profile, built in (`assets/sensors`) or given by path.
//! Angles are in degrees as in the profile; [`SensorProfile::pattern`] turns them
//! into unit vectors of the sensor frame (x forward, y left, z up).

use std::num::NonZeroU32;
use std::path::Path;

use edgepuck_assets::SENSORS;
use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, InvalidValue};

pub use cone::Cone;
pub use detection_limit::DetectionLimit;
pub(crate) use detection_limit::LARGEST_M;
pub use footprint::BeamShape;
pub use grid::Grid;
pub(crate) use pattern::starts;
pub use pattern::{BeamPattern, Directions};
pub use risley::{Line, Prism, Risley};
pub use rotating::{Beam, Rotating};
pub use table::Table;
pub use uniform::Uniform;
pub use views::Views;

mod coherence;
mod cone;
mod detection_limit;
mod footprint;
mod grid;
mod ouster;
mod pattern;
mod plausible;
mod profile;
mod risley;
mod rotating;
mod step;
mod table;
mod uniform;
mod views;

#[cfg(test)]
mod tests;

/// The names of the built-in sensors, the default one first.
pub fn builtin_names() -> impl Iterator<Item = &'static str> {
    SENSORS.into_iter().map(|(name, _)| name)
}

/// The most rays of a sensor: an image of 8192 x 8192 pixels, whose pattern takes 2.5 GB.
pub const MAX_RAYS: u64 = 1 << 26;

/// The most rings: a point's ring has 16 bits.
const MAX_RINGS: f64 = u16::MAX as f64;

/// A sensor, checked: its pattern can be built without error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "profile::Profile")]
pub struct SensorProfile {
    /// A short name, as in `--sensor`.
    pub name: String,
    /// A description in one line.
    pub description: String,
    /// The sources of the constants.
    pub sources: Vec<String>,
    /// The ranges it measures.
    pub range: RangeLimits,
    /// The noise, applied only on request.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<TypicalNoise>,
    /// The detection limit, applied only with the detection effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detection: Option<DetectionLimit>,
    /// The width of the beams, applied only with the footprint effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub footprint: Option<BeamShape>,
    /// The arrangement of the beams.
    #[serde(flatten)]
    pub layout: Layout,
    /// Every `decimation`-th azimuth step or pixel column is kept; 1 keeps all.
    pub decimation: NonZeroU32,
    /// The revolutions per scan, or the frames of a sensor that does not turn; 1 by default.
    #[serde(skip_serializing_if = "is_one")]
    pub revolutions: NonZeroU32,
}

fn is_one(number: &NonZeroU32) -> bool {
    *number == NonZeroU32::MIN
}

/// The ranges that a sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeLimits {
    /// Nearest range in metres, 0 or more; default 0.
    #[serde(default)]
    pub min_m: f64,
    /// Farthest range in metres.
    pub max_m: f64,
    /// The unit of reported ranges, metres, applied only with the quantisation effect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantum_m: Option<f64>,
}

/// The noise of a sensor: what its maker states, and what was measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TypicalNoise {
    /// Standard deviation of the range in metres: the accuracy that the maker states.
    pub typical_sigma_m: f64,
    /// Standard deviation of the range from turn to turn, metres, if it was measured:
    /// `edgepuck calibrate` does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeatability_m: Option<f64>,
}

impl TypicalNoise {
    /// The standard deviation of simulated ranges where a recipe states none, metres: the measured
    /// one, or else that of the maker.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        self.repeatability_m.unwrap_or(self.typical_sigma_m)
    }
}

/// The arrangement of the beams.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// A table of beams that turns and fires in sequence.
    Rotating(Rotating),
    /// A regular grid in azimuth and elevation.
    Uniform(Uniform),
    /// The pixels of a camera.
    Grid(Grid),
    /// Lines of lasers behind turning prisms.
    Risley(Risley),
    /// A table of directions.
    Table(Table),
}

impl SensorProfile {
    /// The built-in sensor of this name, if there is one.
    #[must_use]
    pub fn builtin(name: &str) -> Option<Self> {
        let (_, text) = SENSORS.iter().find(|(known, _)| *known == name)?;
        let sensor = profile::parse(text, Path::new(name));
        Some(sensor.expect("invariant: a test parses all built-in profiles"))
    }

    /// Reads a profile, or an Ouster sensor's metadata if the name of `file` ends with `.json`.
    pub fn load(file: &Path) -> Result<Self, ConfigError> {
        match file.extension().and_then(|extension| extension.to_str()) {
            Some("json") => ouster::load(file),
            Some("csv") => {
                let cause = "expected a profile in TOML, which names a table in CSV by this key";
                Err(ConfigError::value(file, InvalidValue::new("table.file", cause)))
            }
            _ => profile::load(file),
        }
    }

    /// A built-in sensor by name, or else a profile by path.
    pub fn resolve(name_or_path: &str) -> Result<Self, ConfigError> {
        Self::resolve_in(Path::new(""), name_or_path)
    }

    /// As [`SensorProfile::resolve`], with relative paths taken from `folder`.
    pub fn resolve_in(folder: &Path, name_or_path: &str) -> Result<Self, ConfigError> {
        if let Some(sensor) = Self::builtin(name_or_path) {
            return Ok(sensor);
        }
        let file = folder.join(name_or_path);
        let meant_as_path = name_or_path.contains(['/', '\\'])
            || [".toml", ".json"].iter().any(|extension| name_or_path.ends_with(extension));
        if meant_as_path || file.exists() {
            return Self::load(&file);
        }
        let known = builtin_names().collect::<Vec<_>>().join(", ");
        Err(ConfigError::UnknownSensor { name: name_or_path.to_owned(), known })
    }

    /// The beams of one revolution or image.
    #[must_use]
    pub fn pattern(&self) -> BeamPattern {
        let (keep_each, revolutions) = (self.decimation.get(), self.revolutions.get());
        let rays = match &self.layout {
            Layout::Rotating(rotating) => rotating.rays(keep_each, revolutions),
            Layout::Uniform(uniform) => uniform.rays(keep_each),
            Layout::Grid(grid) => grid.rays(keep_each),
            Layout::Risley(risley) => risley.rays(keep_each, revolutions),
            Layout::Table(table) => table.rays(keep_each, revolutions),
        };
        rays.into_pattern()
    }

    /// The same sensor with this number of revolutions, or frames, per scan.
    pub fn with_revolutions(self, revolutions: NonZeroU32) -> Result<Self, InvalidValue> {
        let repeated = Self { revolutions, ..self };
        repeated.check_revolutions()?;
        Ok(repeated)
    }

    fn check_revolutions(&self) -> Result<(), InvalidValue> {
        let revolutions = self.revolutions.get();
        if revolutions == 1 {
            return Ok(());
        }
        let n_rays = match &self.layout {
            Layout::Uniform(_) | Layout::Grid(_) => {
                let cause = "expected 1, as all scans of [uniform] and [grid] are alike";
                return Err(InvalidValue::new("revolutions", cause));
            }
            Layout::Rotating(rotating) => rotating.rays_in(revolutions),
            Layout::Risley(risley) => risley.rays_in(revolutions),
            Layout::Table(table) => table.rays_in(revolutions),
        };
        checked_ray_count("revolutions", n_rays)
    }

    /// The same sensor without the rows of a table that its scans do not use.
    #[must_use]
    pub fn trimmed(mut self) -> Self {
        if let Layout::Table(table) = &mut self.layout {
            table.trim(self.revolutions.get());
        }
        self
    }

    /// The same sensor with only each `k`-th azimuth step or column of pixels, from the first on.
    #[must_use]
    pub fn decimated(&self, k: NonZeroU32) -> Self {
        Self { decimation: self.decimation.saturating_mul(k), ..self.clone() }
    }

    /// Full angles of its beams' divergence, degrees: its own, or else 3 mrad, as LISA has them.
    #[must_use]
    pub fn beam_divergence_deg(&self) -> [f64; 2] {
        self.footprint.map_or([0.172; 2], |footprint| footprint.divergence_deg)
    }

    /// The views this sensor is meant for: [`Views::STATIC`] for a camera and [`Views::ROTATING`] for
    /// all others.
    #[must_use]
    pub fn default_views(&self) -> Views {
        match self.layout {
            Layout::Grid(_) => Views::STATIC,
            _ => Views::ROTATING,
        }
    }
}

/// The rays of a layout in firing order.
struct Rays {
    directions: Vec<glam::DVec3>,
    ring: Vec<u16>,
    time_s: Vec<f64>,
    /// As [`BeamPattern::starts_m`].
    starts_m: Vec<glam::DVec3>,
}

impl Rays {
    fn with_capacity(n_rays: usize) -> Self {
        Self {
            directions: Vec::with_capacity(n_rays),
            ring: Vec::with_capacity(n_rays),
            time_s: Vec::with_capacity(n_rays),
            starts_m: Vec::new(),
        }
    }

    fn into_pattern(self) -> BeamPattern {
        let mut pattern = BeamPattern::new(self.directions, self.ring, self.time_s);
        pattern.starts_m = self.starts_m;
        pattern
    }

    fn push(&mut self, direction: glam::DVec3, ring: u16, time_s: f64) {
        self.directions.push(direction);
        self.ring.push(ring);
        self.time_s.push(time_s);
    }
}

fn checked_ray_count(key: &str, n_rays: u64) -> Result<(), InvalidValue> {
    match n_rays {
        0 => Err(InvalidValue::new(key, "expected at least one ray, found none")),
        1..=MAX_RAYS => Ok(()),
        _ => {
            let cause = format!("expected at most {MAX_RAYS} rays, found {n_rays}");
            Err(InvalidValue::new(key, cause))
        }
    }
}
