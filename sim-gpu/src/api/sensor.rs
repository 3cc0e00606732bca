//! A sensor and the beams that belong to it.

use super::Error;
use crate::config::{InvalidValue, did_you_mean};
use crate::effects::{Effects, Footprint};
use crate::packets;
use crate::sensor::{BeamPattern, SensorProfile, builtin_names};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A LiDAR or depth camera: its profile, and the beams that the profile describes.
///
/// A clone shares the beams, which the first scan makes. A sensor is serialised as its profile.
///
/// ```
/// # use sim_gpu::Sensor;
/// let sensor = Sensor::named("vlp32c")?;
/// assert_eq!(sensor.directions().len(), 57_870);
/// assert_eq!(sensor.rings().iter().max(), Some(&31));
/// # Ok::<(), sim_gpu::Error>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(from = "SensorProfile", into = "SensorProfile")]
pub struct Sensor {
    profile: Arc<SensorProfile>,
    pattern: Arc<OnceLock<Arc<BeamPattern>>>,
    /// The rays of its beams for the footprint that was asked for last.
    widened: Arc<Mutex<Option<Widened>>>,
}

/// A footprint, and the rays that it makes of the beams.
type Widened = (Footprint, Arc<BeamPattern>);

impl Sensor {
    /// The built-in sensor of this name; [`Sensor::names`] lists them.
    ///
    /// # Errors
    /// There is no such sensor: the message lists those that there are.
    pub fn named(name: &str) -> Result<Self, Error> {
        let unknown = || {
            let known = Self::names().collect::<Vec<_>>().join(", ");
            InvalidValue::new("sensor", {
                let meant = did_you_mean(name, Self::names());
                format!("expected one of {known}, found \"{name}\"{meant}")
            })
        };
        Ok(Self::from(SensorProfile::builtin(name).ok_or_else(unknown)?))
    }

    /// The names of the built-in sensors.
    pub fn names() -> impl Iterator<Item = &'static str> {
        builtin_names()
    }

    /// Reads a sensor's profile (TOML), or the metadata of an Ouster (JSON).
    ///
    /// # Errors
    /// With the file, the key and the cause.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Ok(Self::from(SensorProfile::load(path.as_ref())?))
    }

    /// The built-in sensor of this name or, if it ends in `.toml` or `.json`, that of this file.
    ///
    /// # Errors
    /// As [`Sensor::named`] and [`Sensor::read`].
    pub fn resolve(name_or_file: &str) -> Result<Self, Error> {
        Ok(Self::from(SensorProfile::resolve(name_or_file)?))
    }

    /// The same VLP-32C with the beams that its packets encode: they start beside the sensor's axis,
    /// at azimuths in hundredths of a degree. Scans of such a sensor can be saved as `.pcap`.
    ///
    /// # Errors
    /// The sensor is not a VLP-32C.
    pub fn with_packet_geometry(&self) -> Result<Self, Error> {
        Ok(Self::from(packets::with_packet_geometry(&self.profile)?))
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.profile.name
    }

    /// Unit vectors of all beams in the sensor's frame (x forward, y left, z up), in the order of
    /// firing, `[n_beams]`.
    #[must_use]
    pub fn directions(&self) -> &[DVec3] {
        &self.pattern().directions
    }

    /// The ring of each beam, counted from below, `[n_beams]`.
    #[must_use]
    pub fn rings(&self) -> &[u16] {
        &self.pattern().ring
    }

    /// When each beam fires after the start of the revolution, seconds, `[n_beams]`.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        &self.pattern().time_s
    }

    /// The profile.
    #[doc(hidden)]
    #[must_use]
    pub fn profile(&self) -> &SensorProfile {
        &self.profile
    }

    /// The beams.
    #[doc(hidden)]
    #[must_use]
    pub fn pattern(&self) -> &Arc<BeamPattern> {
        self.pattern.get_or_init(|| Arc::new(self.profile.pattern()))
    }

    /// The rays that are cast for `effects`: several for each beam that has a width.
    ///
    /// # Errors
    /// As [`Effects::widen`].
    #[doc(hidden)]
    pub fn rays(&self, effects: &Effects) -> Result<Arc<BeamPattern>, InvalidValue> {
        let Some(footprint) = effects.footprint else { return Ok(Arc::clone(self.pattern())) };
        if let Some((of, rays)) = &*self.widened.lock().unwrap_or_else(PoisonError::into_inner)
            && *of == footprint
        {
            return Ok(Arc::clone(rays));
        }
        let rays = Arc::new(effects.widen((**self.pattern()).clone(), &self.profile)?);
        let mut widened = self.widened.lock().unwrap_or_else(PoisonError::into_inner);
        *widened = Some((footprint, Arc::clone(&rays)));
        Ok(rays)
    }
}

impl PartialEq for Sensor {
    /// Whether their profiles are equal, which decide the beams.
    fn eq(&self, other: &Self) -> bool {
        self.profile == other.profile
    }
}

impl From<Sensor> for SensorProfile {
    fn from(sensor: Sensor) -> Self {
        Arc::unwrap_or_clone(sensor.profile)
    }
}

impl From<SensorProfile> for Sensor {
    fn from(profile: SensorProfile) -> Self {
        let (profile, pattern, widened) = (Arc::new(profile), Arc::default(), Arc::default());
        Self { profile, pattern, widened }
    }
}
