//! Settings as a user gives them, by names, numbers and files.

use crate::config::{DatasetConfig, SetConfig, Variant, Viewpoints};
use crate::error::DatasetError;
use edgepuck_mesh::frame::{Normalize, Unit};
use formats::scan::Attribute;
use formats::scan_file::ScanFormat;
use serde::Deserialize;
use sim_gpu::Sensor;
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel};
use sim_gpu::errors::{ConfigError, InvalidValue};
use sim_gpu::sensors::{Layout, SensorProfile};
use sim_gpu::settings;
use std::path::Path;

/// The dataset that `gen-dataset` makes by default: clean scans of a VLP-32C and of a static sensor.
impl Default for DatasetConfig {
    fn default() -> Self {
        let set = |sensor| SetConfig::of(sensor).expect("invariant: the sensor is built in");
        let sets = ["vlp32c", "generic-static"].map(set).into();
        Self::new(sets).checked().expect("invariant: no effect fits any sensor")
    }
}

impl DatasetConfig {
    /// Completes these settings: NPZ is among the formats, intensity among the effects if points have it,
    /// and there are noisy scans if there is any other effect.
    ///
    /// # Errors
    /// A unit for meshes that are scaled anyway; effects that do not fit a sensor.
    pub fn checked(mut self) -> Result<Self, InvalidValue> {
        if self.units != Unit::Metre && self.normalize != Normalize::None {
            let cause =
                "expected meshes that keep their size (normalize none), since others are scaled";
            return Err(InvalidValue::new("units", cause));
        }
        self.formats.push(ScanFormat::Npz);
        self.formats.sort_unstable();
        self.formats.dedup();
        if self.attributes.contains(&Attribute::Intensity) {
            self.effects.intensity.get_or_insert(Intensity);
        }
        for set in &self.sets {
            self.effects.for_sensor(set.sensor.profile())?;
        }
        self.variants = vec![Variant::Clean];
        self.variants.extend((self.effects != self.effects.clean()).then_some(Variant::Noisy));
        Ok(self)
    }
}

/// Most views of a mesh if each scan is a file of its own.
pub(crate) const MOST_VIEWS: usize = 65_535;

impl DatasetConfig {
    /// Checks that tars are of one sensor and nothing else, and that files are not too many.
    ///
    /// # Errors
    /// A layout that cannot hold the files, the sensors or the number of views.
    pub fn check(&self) -> Result<(), DatasetError> {
        let layout = crate::config::Layout::Webdataset;
        if self.layouts.contains(&layout) {
            let cause = if self.layouts.len() > 1 || self.formats != [ScanFormat::Npz] {
                Some("it writes tars alone: name no other layout or format")
            } else if self.sets.len() != 1 {
                Some("it holds the clouds of one sensor: name it with --sensor")
            } else {
                None
            };
            let refuse = |cause| Err(DatasetError::Layout { layout: layout.name(), cause });
            return cause.map_or(Ok(()), refuse);
        }
        Ok(self.check_views()?)
    }

    /// Checks that each mesh has no more views than there are numbers for, unless tars hold them.
    pub(crate) fn check_views(&self) -> Result<(), InvalidValue> {
        let counts = self.sets.iter().map(|set| set.viewpoints.count());
        let most = counts.max().unwrap_or(0);
        if most > MOST_VIEWS && self.layouts.is_empty() {
            let cause = format!(
                "expected at most {MOST_VIEWS} where each scan is a file, found {most}; the layout \
                 webdataset takes any number"
            );
            return Err(InvalidValue::new("views", cause));
        }
        Ok(())
    }
}

impl SetConfig {
    /// The set of a built-in sensor or of the profile in a file. Its name is that of the kind of its beams:
    /// `rotational`, `static`, `rosette` or `table`.
    ///
    /// # Errors
    /// There is no such sensor, or its profile is invalid.
    pub fn of(sensor: &str) -> Result<Self, ConfigError> {
        let sensor = Sensor::from(SensorProfile::resolve(sensor)?.trimmed());
        let name = match &sensor.profile().layout {
            Layout::Rotating(_) | Layout::Uniform(_) => "rotational",
            Layout::Grid(_) => "static",
            Layout::Risley(_) => "rosette",
            Layout::Table(_) => "table",
        };
        Ok(Self::new(name, sensor))
    }

    /// The same set at its usual viewpoints, but for those numbers of `around` that
    /// are there.
    ///
    /// # Errors
    /// A number out of its bounds.
    pub fn seen_from(self, around: Around) -> Result<Self, InvalidValue> {
        let mut views = self.sensor.profile().default_views();
        views.count = around.count.unwrap_or(views.count);
        if let Some((from, to)) = around.distance_m {
            (views.distance_m, views.distance_to_m) = (from, to);
        }
        if let Some((from, to)) = around.elevation_deg {
            (views.elevation_deg, views.elevation_to_deg) = (from, to);
        }
        views.azimuth_jitter_deg = around.azimuth_jitter_deg.unwrap_or(views.azimuth_jitter_deg);
        views.validate()?;
        Ok(Self { viewpoints: Viewpoints::Views(views), ..self })
    }
}

/// Ranges with normal noise of this standard deviation, metres, of which each is lost with the
/// probability `dropout`.
///
/// # Errors
/// A number out of its bounds.
pub fn noisy(sigma_m: f64, dropout: f64) -> Result<Effects, InvalidValue> {
    let noise = Noise { mean_m: 0.0, sigma_m, model: NoiseModel::Range };
    let effects = Effects {
        noise: (sigma_m != 0.0).then_some(noise),
        dropout: (dropout != 0.0).then_some(Dropout { probability: dropout }),
        ..Effects::default()
    };
    effects.validate().map(|()| effects)
}

/// Reads the effects of scans of meshes from the table `[effects]` of a TOML file. In its weather, beams
/// that meet no mesh have no returns, unless the file says so.
///
/// # Errors
/// A file that cannot be read, or a value that is invalid.
pub fn read_effects(file: &Path) -> Result<Effects, ConfigError> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct EffectsFile {
        effects: Effects,
    }
    let whole = |EffectsFile { effects }| Ok::<_, InvalidValue>(effects);
    let mut effects = settings::read(file, "effects", whole)?;
    if let Some(weather) = &mut effects.weather {
        weather.empty_beams.get_or_insert(false);
    }
    Ok(effects)
}

/// Viewpoints around a mesh, of which `None` is the sensor's own. Of two bounds, each view has a number
/// drawn between them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Around {
    /// The number of viewpoints.
    pub count: Option<u32>,
    /// The distance from the mesh's centre, metres.
    pub distance_m: Option<(f64, Option<f64>)>,
    /// The elevation above the mesh, degrees.
    pub elevation_deg: Option<(f64, Option<f64>)>,
    /// The largest random turn of each view around the mesh, degrees.
    pub azimuth_jitter_deg: Option<f64>,
}
