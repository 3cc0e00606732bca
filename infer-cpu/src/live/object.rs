//! What is said of a cluster.

use std::sync::Arc;

use serde::{Serialize, Serializer};

/// The version of what [`Object`] is written as. A field that goes or changes its meaning raises
/// it; a new field at the end does not.
pub const SCHEMA_VERSION: u32 = 1;

/// A cluster, named and tracked. As JSON, the fields are in this order.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Object {
    /// [`SCHEMA_VERSION`].
    pub version: u32,
    /// The number of the turn, from 0.
    pub turn: u64,
    /// The number of its track, from 1.
    pub track: u64,
    /// The class of the track by all that was seen of it, or `unknown`; `None` where no cluster of
    /// it had enough points to be classified.
    #[serde(serialize_with = "name")]
    pub class: Option<Arc<str>>,
    /// The class that the track is most like, also where that is none that the model is to
    /// tell apart.
    #[serde(serialize_with = "name")]
    pub resembles: Option<Arc<str>>,
    /// The probability of `resembles` by this cluster alone, at the temperature at which the model
    /// was calibrated; `None` where it has too few points.
    #[serde(serialize_with = "rounded")]
    pub confidence: Option<f64>,
    /// The probability of `resembles` by all clusters of the track.
    #[serde(serialize_with = "rounded")]
    pub probability: Option<f64>,
    /// The frame of positions and velocities: `sensor`, or `world` where the sensor's
    /// motion is known.
    pub frame: &'static str,
    /// The middle of the box around the points, metres.
    #[serde(serialize_with = "rounded_all")]
    pub position_m: [f64; 3],
    /// Length, width and height of that box, metres.
    #[serde(serialize_with = "rounded_all")]
    pub size_m: [f64; 3],
    /// The direction of the length, degrees counterclockwise from x, -90 to 90: points alone do
    /// not tell front from rear.
    #[serde(serialize_with = "rounded_one")]
    pub yaw_deg: f64,
    /// The velocity of the track, metres a second; `None` of what was seen once. In the sensor's
    /// frame it is relative to the sensor.
    #[serde(serialize_with = "rounded_some")]
    pub velocity_m_s: Option<[f64; 3]>,
    /// The number of points.
    pub points: usize,
    /// The horizontal distance from the sensor, metres.
    #[serde(serialize_with = "rounded_one")]
    pub range_m: f64,
    /// When the first point was measured, seconds of Unix time by the sensor's clock.
    pub first_s: f64,
    /// When the last point was.
    pub last_s: f64,
    /// From the arrival of the packet with the last point to this answer, milliseconds; `None`
    /// where packets do not come at their time.
    #[serde(serialize_with = "rounded")]
    pub latency_ms: Option<f64>,
}

/// To the millimetre, and to the thousandth of all else: a sensor's noise is ten times that.
fn thousandths(x: f64) -> f64 {
    (x * 1e3).round() / 1e3
}

fn rounded<S: Serializer>(x: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    x.map(thousandths).serialize(serializer)
}

fn rounded_one<S: Serializer>(x: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    thousandths(*x).serialize(serializer)
}

fn rounded_all<S: Serializer>(x: &[f64; 3], serializer: S) -> Result<S::Ok, S::Error> {
    x.map(thousandths).serialize(serializer)
}

fn rounded_some<S: Serializer>(x: &Option<[f64; 3]>, serializer: S) -> Result<S::Ok, S::Error> {
    x.map(|x| x.map(thousandths)).serialize(serializer)
}

fn name<S: Serializer>(name: &Option<Arc<str>>, serializer: S) -> Result<S::Ok, S::Error> {
    name.as_deref().serialize(serializer)
}
