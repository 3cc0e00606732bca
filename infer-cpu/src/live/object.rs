use std::sync::Arc;

use formats::geometry::OrientedBox;
use serde::{Serialize, Serializer};

/// The version of the JSON form of [`Object`]. Removing a field or changing its meaning raises it;
/// a new field at the end does not.
pub const SCHEMA_VERSION: u32 = 1;

/// A tracked object, or a cluster in which none was seen. The fields of the JSON form are in this order.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Object {
    /// [`SCHEMA_VERSION`].
    pub version: u32,
    /// The number of the turn, from 0.
    pub turn: u64,
    /// The number of its track, from 1.
    pub track: u64,
    /// The class of the track, from all turns, or `unknown`; `None` if it never had enough points for
    /// one.
    #[serde(serialize_with = "name")]
    pub class: Option<Arc<str>>,
    /// The class that the track resembles most, even if `class` is `unknown`.
    #[serde(serialize_with = "name")]
    pub resembles: Option<Arc<str>>,
    /// The probability of `resembles` from this turn alone; `None` with too few points.
    #[serde(serialize_with = "rounded")]
    pub confidence: Option<f64>,
    /// The probability of `resembles` from all turns.
    #[serde(serialize_with = "rounded")]
    pub probability: Option<f64>,
    /// The frame of positions and velocities: `sensor`, or `world` if the motion of the sensor is
    /// known.
    pub frame: &'static str,
    /// The middle of the box around the points, metres.
    #[serde(serialize_with = "rounded")]
    pub position_m: [f64; 3],
    /// Length, width and height of that box, metres.
    #[serde(serialize_with = "rounded")]
    pub size_m: [f64; 3],
    /// The direction of the length, degrees counterclockwise from x, -90 to 90: points alone do not
    /// distinguish front and rear.
    #[serde(serialize_with = "rounded")]
    pub yaw_deg: f64,
    /// The velocity of the track, metres per second; `None` for its first cluster. In the sensor's
    /// frame it is relative to the sensor.
    #[serde(serialize_with = "rounded")]
    pub velocity_m_s: Option<[f64; 3]>,
    /// The number of points.
    pub points: usize,
    /// The horizontal distance from the sensor, metres.
    #[serde(serialize_with = "rounded")]
    pub range_m: f64,
    /// When the first point was measured: Unix time in seconds by the sensor's clock.
    pub first_s: f64,
    /// When the last point was measured.
    pub last_s: f64,
    /// The time from the arrival of the packet with the last point to this result, milliseconds;
    /// `None` if packets do not arrive in real time.
    #[serde(serialize_with = "rounded")]
    pub latency_ms: Option<f64>,
    /// The box of the whole object: its near side is that of this turn, and its size and direction
    /// are from all turns. `None` while the track is unknown. Its direction is in
    /// -pi..=pi: that of the front once the object has moved, if the motion of the sensor is known. In
    /// JSON it has `centre_m`, `size_m` and `yaw_deg`.
    #[serde(serialize_with = "box_in_degrees")]
    pub whole_box: Option<OrientedBox>,
}

/// Numbers that are written in thousandths, such as millimetres: the noise of a sensor is ten times
/// larger.
trait Thousandths: Copy + Serialize {
    fn thousandths(self) -> Self;
}

impl Thousandths for f64 {
    fn thousandths(self) -> Self {
        (self * 1e3).round() / 1e3
    }
}

impl Thousandths for [f64; 3] {
    fn thousandths(self) -> Self {
        self.map(f64::thousandths)
    }
}

impl<T: Thousandths> Thousandths for Option<T> {
    fn thousandths(self) -> Self {
        self.map(T::thousandths)
    }
}

fn rounded<T: Thousandths, S: Serializer>(x: &T, serializer: S) -> Result<S::Ok, S::Error> {
    x.thousandths().serialize(serializer)
}

fn name<S: Serializer>(name: &Option<Arc<str>>, serializer: S) -> Result<S::Ok, S::Error> {
    name.as_deref().serialize(serializer)
}

fn box_in_degrees<S: Serializer>(
    of: &Option<OrientedBox>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Written {
        centre_m: [f64; 3],
        size_m: [f64; 3],
        yaw_deg: f64,
    }
    let written = of.map(|OrientedBox { centre_m, size_m, yaw_rad }| Written {
        centre_m: centre_m.thousandths(),
        size_m: size_m.thousandths(),
        yaw_deg: yaw_rad.to_degrees().thousandths(),
    });
    written.serialize(serializer)
}
