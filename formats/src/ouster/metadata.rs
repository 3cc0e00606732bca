//! The metadata of a sensor.

use std::ops::RangeInclusive;
use std::path::Path;

use serde_json::Value;

use crate::error::FormatError;
use crate::plausible::{or_foreign_file, read_text};

/// The longest metadata, bytes.
const LONGEST: u64 = 4 << 20;

crate::named! {
    /// The contents of a packet's pixels, in words of 32 bits. Ranges are in millimetres unless
    /// stated otherwise. Other fields are skipped.
    #[derive(Default)]
    pub enum Profile: "lidar profile" {
        /// Three words: range of 20 bits; reflectivity u8 at byte 4.
        #[default]
        Legacy = "LEGACY",
        /// Three words: range of 19 bits; reflectivity u8 at byte 4.
        Single = "RNG19_RFL8_SIG16_NIR16",
        /// Four words, the first two for a return each: range of 19 bits, reflectivity u8 at byte 3.
        Dual = "RNG19_RFL8_SIG16_NIR16_DUAL",
        /// One word: range of 15 bits in units of 8 mm; reflectivity u8 at byte 2.
        LowRate = "RNG15_RFL8_NIR8",
    }
}

/// The metadata of a sensor that decoding needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    pub(super) profile: Profile,
    pub(super) is_fusa: bool,
    /// Columns of a turn.
    pub columns_per_frame: u16,
    /// Columns of each packet.
    pub columns_per_packet: u16,
    /// The first and the last column that are sent. The first may have the larger number.
    pub(super) column_window: [u16; 2],
    /// Turns per second.
    pub rate_hz: f64,
    /// Altitude of each row, and azimuth clockwise from the encoder's direction, degrees.
    pub beams_deg: Vec<[f64; 2]>,
    /// x and z of the origin of the beams while the encoder is at 0, metres, in the lidar frame.
    pub origin_m: [f64; 2],
    /// The upper three rows of the transform, metres.
    pub(super) lidar_to_sensor: [[f64; 4]; 3],
}

impl Metadata {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// A file that cannot be read; as [`Metadata::parse`].
    pub fn read(path: &Path) -> Result<Self, FormatError> {
        Self::read_as(path, profile)
    }

    /// As [`Metadata::read`], for the beams alone: packets may have any profile.
    ///
    /// # Errors
    /// As [`Metadata::read`].
    pub fn read_beams(path: &Path) -> Result<Self, FormatError> {
        let nearest = |value: &Value| {
            let is_coarse = value.as_str().is_some_and(|name| name.contains("RNG15"));
            Ok(if is_coarse { Profile::LowRate } else { Profile::Single })
        };
        Self::read_as(path, nearest)
    }

    /// Parses `text`, which errors attribute to `path`. It knows both layouts: the nested one, and
    /// the flat one of older firmware and programs. What the oldest do not state is as ouster-sdk
    /// has it (`default_data_format` and others in `types.cpp`).
    ///
    /// # Errors
    /// Text that is not JSON; a required field that is missing or invalid.
    pub fn parse(text: &str, path: &Path) -> Result<Self, FormatError> {
        Self::parse_as(text, path, profile)
    }

    fn read_as(
        path: &Path,
        profile: impl Fn(&Value) -> Result<Profile, String>,
    ) -> Result<Self, FormatError> {
        let read = read_text(path, LONGEST + 1)
            .map_err(|source| FormatError::io(path, source))
            .and_then(|text| Self::parse_as(&text, path, profile));
        read.map_err(|error| or_foreign_file(path, "metadata in JSON", error))
    }

    fn parse_as(
        text: &str,
        path: &Path,
        profile: impl Fn(&Value) -> Result<Profile, String>,
    ) -> Result<Self, FormatError> {
        if text.len() as u64 > LONGEST {
            let cause = format!("expected at most {LONGEST} bytes, found more");
            return Err(FormatError::malformed(path, "metadata", cause));
        }
        let root: Value = serde_json::from_str(text).map_err(|cause| {
            FormatError::malformed(path, "metadata", format!("expected JSON: {cause}"))
        })?;
        let fields = Fields { path, root: &root, is_nested: root.get("beam_intrinsics").is_some() };
        if root["beam_intrinsics"].is_null() && root["beam_altitude_angles"].is_null() {
            let cause = "expected those of an Ouster, found JSON without beam_altitude_angles";
            return Err(FormatError::malformed(path, "metadata", cause));
        }
        let has_format = root
            .pointer(FORMAT[usize::from(fields.is_nested)])
            .is_some_and(|format| !format.is_null());
        let format = |name: &str, range, default: &dyn Fn() -> Result<u16, FormatError>| {
            if has_format { fields.get(FORMAT, name, |v| whole(v, range)) } else { default() }
        };
        let columns_of_mode = || fields.get(CONFIG, "lidar_mode", |v| mode(v).map(|[n, _]| n));
        let columns_per_frame = format("columns_per_frame", 1..=4096, &columns_of_mode)?;
        let listed = || fields.get(BEAMS, "beam_altitude_angles", n_rows);
        let rows = format("pixels_per_column", 1..=256, &listed)?;
        let altitudes = fields.get(BEAMS, "beam_altitude_angles", |v| numbers(v, rows, 90.0))?;
        let azimuths = fields.get(BEAMS, "beam_azimuth_angles", |v| numbers(v, rows, 360.0))?;
        Ok(Self {
            // Firmware before 2.1 has only this profile and does not name it.
            profile: fields.optional(FORMAT, "udp_profile_lidar", profile)?.unwrap_or_default(),
            is_fusa: fields.optional(FORMAT, "header_type", is_fusa)?.unwrap_or_default(),
            columns_per_frame,
            columns_per_packet: format("columns_per_packet", 1..=64, &|| Ok(16))?,
            column_window: fields
                .optional(FORMAT, "column_window", |v| window(v, columns_per_frame))?
                .unwrap_or([0, columns_per_frame - 1]),
            rate_hz: fields.get(CONFIG, "lidar_mode", |v| rate_hz(v, columns_per_frame))?,
            beams_deg: altitudes.into_iter().zip(azimuths).map(|(p, a)| [p, a]).collect(),
            origin_m: fields.origin_m()?,
            lidar_to_sensor: fields
                .optional(LIDAR, "lidar_to_sensor_transform", rigid)?
                .unwrap_or(LIDAR_TO_SENSOR),
        })
    }
}

impl Metadata {
    /// Columns of a turn that the sensor does not send.
    #[must_use]
    pub fn n_columns_unsent(&self) -> u16 {
        let [first, last] = self.column_window;
        let sent = (last + self.columns_per_frame - first) % self.columns_per_frame + 1;
        self.columns_per_frame - sent
    }

    /// The unit of the ranges in its packets, metres.
    #[must_use]
    pub fn range_unit_m(&self) -> f64 {
        if self.profile == Profile::LowRate { 0.008 } else { 0.001 }
    }

    /// Rotation of the lidar frame in the sensor's frame about z, radians counterclockwise.
    #[must_use]
    pub fn yaw_rad(&self) -> f64 {
        libm::atan2(self.lidar_to_sensor[1][0], self.lidar_to_sensor[0][0])
    }
}

/// The sections of fields, in the flat layout and in the nested one.
type Section = [&'static str; 2];
const FORMAT: Section = ["/data_format", "/lidar_data_format"];
const BEAMS: Section = ["", "/beam_intrinsics"];
const LIDAR: Section = ["", "/lidar_intrinsics"];
const CONFIG: Section = ["", "/config_params"];
const PRODUCT: Section = ["", "/sensor_info"];

/// The transform of sensors that do not state it: half a turn, and up by 36.18 mm.
const LIDAR_TO_SENSOR: [[f64; 4]; 3] =
    [[-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 36.18 * 1e-3]];

struct Fields<'a> {
    path: &'a Path,
    root: &'a Value,
    is_nested: bool,
}

impl Fields<'_> {
    fn optional<T>(
        &self,
        section: Section,
        name: &str,
        parse: impl FnOnce(&Value) -> Result<T, String>,
    ) -> Result<Option<T>, FormatError> {
        let pointer = format!("{}/{name}", section[usize::from(self.is_nested)]);
        let parsed = self.root.pointer(&pointer).map(parse).transpose();
        parsed.map_err(|cause| self.error(&pointer, cause))
    }

    fn get<T>(
        &self,
        section: Section,
        name: &str,
        parse: impl FnOnce(&Value) -> Result<T, String>,
    ) -> Result<T, FormatError> {
        let pointer = format!("{}/{name}", section[usize::from(self.is_nested)]);
        let found = self.optional(section, name, parse)?;
        found.ok_or_else(|| self.error(&pointer, "expected a value, found none".to_owned()))
    }

    fn error(&self, pointer: &str, cause: String) -> FormatError {
        FormatError::malformed(self.path, pointer[1..].replace('/', "."), cause)
    }

    /// The origin of the beams. Older firmware has only the distance from the axis, or none.
    fn origin_m(&self) -> Result<[f64; 2], FormatError> {
        let of_transform = |v: &Value| rows(v).map(|[x, _, z]| [x[3], z[3]]);
        if let Some(origin) = self.optional(BEAMS, "beam_to_lidar_transform", of_transform)? {
            return Ok(origin);
        }
        let name = "lidar_origin_to_beam_origin_mm";
        let found = self.optional(BEAMS, name, |v| number(v, FARTHEST_MM))?;
        let of_line = |line: &Value| match line.as_str().and_then(|line| line.get(..4)) {
            Some("OS-0") => 27.67,
            Some("OS-1") => 15.806,
            Some("OS-2") => 13.762,
            _ => 12.163,
        };
        let by_line = self.optional(PRODUCT, "prod_line", |line| Ok(of_line(line)))?;
        let mm = found.or(by_line).unwrap_or(of_line(&Value::Null));
        Ok([mm * 1e-3, 0.0])
    }
}

/// The largest distance between parts of a sensor, millimetres.
const FARTHEST_MM: f64 = 1e4;

fn whole(value: &Value, range: RangeInclusive<u16>) -> Result<u16, String> {
    let found = value.as_u64().and_then(|n| u16::try_from(n).ok()).filter(|n| range.contains(n));
    let (least, most) = range.into_inner();
    found.ok_or_else(|| {
        format!("expected a whole number, {least} to {most}, found {}", shown(value))
    })
}

fn number(value: &Value, most: f64) -> Result<f64, String> {
    let found = value.as_f64().filter(|x| x.abs() <= most);
    found.ok_or_else(|| format!("expected a number, -{most} to {most}, found {}", shown(value)))
}

fn list(value: &Value, n: u16) -> Result<&[Value], String> {
    match value.as_array() {
        Some(list) if list.len() == usize::from(n) => Ok(list),
        Some(list) => Err(format!("expected {n} values, found {}", list.len())),
        None => Err(format!("expected a list of {n} values, found {}", shown(value))),
    }
}

fn numbers(value: &Value, n: u16, most: f64) -> Result<Vec<f64>, String> {
    list(value, n)?.iter().map(|value| number(value, most)).collect()
}

fn profile(value: &Value) -> Result<Profile, String> {
    let name = value.as_str().ok_or_else(|| format!("expected a name, found {}", shown(value)))?;
    name.parse().map_err(|error: FormatError| error.to_string())
}

fn is_fusa(value: &Value) -> Result<bool, String> {
    match value.as_str() {
        Some("STANDARD") => Ok(false),
        Some("FUSA") => Ok(true),
        _ => Err(format!("expected STANDARD or FUSA, found {}", shown(value))),
    }
}

fn window(value: &Value, columns: u16) -> Result<[u16; 2], String> {
    let column = |i: usize| whole(&list(value, 2)?[i], 0..=columns - 1);
    Ok([column(0)?, column(1)?])
}

/// The turns per second of a mode with these columns per turn.
fn rate_hz(value: &Value, columns: u16) -> Result<f64, String> {
    match mode(value) {
        Ok([found, rate]) if found == columns => Ok(rate.into()),
        _ => Err(format!("expected a mode such as {columns}x10, found {}", shown(value))),
    }
}

/// The columns per turn and the turns per second of a mode such as 1024x10.
fn mode(value: &Value) -> Result<[u16; 2], String> {
    let found = value.as_str().and_then(|mode| {
        let (columns, rate) = mode.split_once('x')?;
        let [columns, rate] = [columns.parse().ok()?, rate.parse().ok()?];
        ((1..=4096).contains(&columns) && (1..=100).contains(&rate)).then_some([columns, rate])
    });
    found.ok_or_else(|| format!("expected a mode such as 1024x10, found {}", shown(value)))
}

fn n_rows(value: &Value) -> Result<u16, String> {
    let n = value.as_array().map_or(0, Vec::len);
    let fits = u16::try_from(n).ok().filter(|n| (1..=256).contains(n));
    fits.ok_or_else(|| format!("expected a list of 1 to 256 values, found {}", shown(value)))
}

/// The upper three rows of a transform, converted from millimetres to metres.
fn rows(value: &Value) -> Result<[[f64; 4]; 3], String> {
    let found = numbers(value, 16, FARTHEST_MM)?;
    let mut rows = [[0.0; 4]; 3];
    for (row, found) in rows.iter_mut().zip(found.chunks_exact(4)) {
        *row = [found[0], found[1], found[2], found[3] * 1e-3];
    }
    Ok(rows)
}

/// As [`transform`], for a rotation and a translation.
fn rigid(value: &Value) -> Result<[[f64; 4]; 3], String> {
    let rows = rows(value)?;
    let product = |i: usize, j: usize| (0..3).map(|k| rows[i][k] * rows[j][k]).sum::<f64>();
    let is_off = |i: usize, j: usize| (product(i, j) - f64::from(i == j)).abs() > 1e-3;
    if (0..3).any(|i| (0..3).any(|j| is_off(i, j))) {
        return Err(format!("expected a rotation and a translation, found {}", shown(value)));
    }
    Ok(rows)
}

fn shown(value: &Value) -> String {
    let text = value.to_string();
    let start: String = text.chars().take(40).collect();
    if start.len() < text.len() { start + "..." } else { start }
}
