//! Beams with a width, and the returns that the sensor reports of them.

use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, within};
use crate::sensor::{BeamShape, LARGEST_M, SensorProfile};

/// Beams with a width: each is cast as several rays of equal power, and surfaces that the receiver
/// cannot resolve become one return between them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Footprint {
    /// Rays of each beam: [`Footprint::SAMPLES`].
    #[serde(default = "usual_samples")]
    pub samples: u32,
    /// The beam's full angles as in [`BeamShape`]; `None` are the sensor's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub divergence_deg: Option<[f64; 2]>,
    /// The distance as in [`BeamShape`]; `None` is the sensor's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separation_m: Option<f64>,
}

formats::named! {
    /// The returns of a beam that a sensor reports. A single return is always reported.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum ReturnMode: "return mode" {
        /// The strongest; the nearest of equals.
        #[default]
        Strongest = "strongest",
        /// The second strongest.
        SecondStrongest = "second-strongest",
        /// The nearest.
        First = "first",
        /// The farthest.
        Last = "last",
        /// The last and the strongest, or the second strongest if the strongest is the last:
        /// VLP-32C User Manual 63-9325, 9.3.2.
        Dual = "dual",
    }
}

impl Footprint {
    /// The possible numbers of rays per beam: a centre and up to three rings around it.
    pub const SAMPLES: [u32; 4] = [1, 7, 19, 37];

    /// The same footprint with missing values taken from `sensor`.
    pub(super) fn for_sensor(&self, sensor: &SensorProfile) -> Result<Self, InvalidValue> {
        let own = sensor.footprint;
        let missing = |key: &str| {
            let key = format!("effects.footprint.{key}");
            let name = &sensor.name;
            let cause = format!("expected a value, as sensor \"{name}\" has no [footprint]");
            InvalidValue::new(key, cause)
        };
        let divergence_deg = self.divergence_deg.or(own.map(|own| own.divergence_deg));
        let separation_m = self.separation_m.or(own.map(|own| own.separation_m));
        Ok(Self {
            divergence_deg: Some(divergence_deg.ok_or_else(|| missing("divergence_deg"))?),
            separation_m: Some(separation_m.ok_or_else(|| missing("separation_m"))?),
            ..*self
        })
    }

    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        if !Self::SAMPLES.contains(&self.samples) {
            let cause = format!("expected 1, 7, 19 or 37, found {}", self.samples);
            return Err(InvalidValue::new("effects.footprint.samples", cause));
        }
        if let Some(divergence_deg) = self.divergence_deg {
            BeamShape::check_divergence("effects.footprint", divergence_deg)?;
        }
        within("effects.footprint.separation_m", self.separation_m, 0.0..=LARGEST_M)
    }
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected true for 19 rays of the sensor's own beam, or a table of samples, \
                 divergence_deg and separation_m as footprint"
)]
pub(super) enum Table {
    Switch(bool),
    Numbers(Footprint),
}

fn usual_samples() -> u32 {
    19
}

impl From<Table> for Option<Footprint> {
    fn from(table: Table) -> Self {
        match table {
            Table::Switch(false) => None,
            Table::Switch(true) => Some(Footprint {
                samples: usual_samples(),
                divergence_deg: None,
                separation_m: None,
            }),
            Table::Numbers(footprint) => Some(footprint),
        }
    }
}

impl From<Footprint> for Table {
    fn from(footprint: Footprint) -> Self {
        Self::Numbers(footprint)
    }
}
