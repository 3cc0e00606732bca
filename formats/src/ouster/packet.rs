//! Decodes one lidar packet.

use super::{Metadata, Profile};
use crate::returns::{Kind, Return};

/// The unit of ranges, metres (ouster-sdk 1.0.1, `RANGE_UNIT`).
const RANGE_UNIT_M: f64 = 0.001;

/// Why a payload is not a lidar packet of the sensor.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PacketError {
    /// The payload has another length, such as that of an IMU packet.
    #[error("expected a lidar packet of {expected} bytes, found {found} bytes")]
    Length {
        /// The length by the metadata.
        expected: usize,
        /// The length of the payload.
        found: usize,
    },
    /// The packet is of another type.
    #[error("expected a packet of type 1 (lidar), found type {0}")]
    Type(u8),
    /// A valid column that does not follow the column before it, or is not in the frame.
    #[error("column {column}: expected measurement {expected} of {per_frame}, found {found}")]
    Measurement {
        /// The column, from 0.
        column: usize,
        /// Its number in the frame, counted from the packet's first column.
        expected: usize,
        /// The number of columns in a frame.
        per_frame: u16,
        /// The number in its header.
        found: u16,
    },
}

/// The header of a packet, with the sizes from the metadata.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header {
    /// The number of its turn, which wraps to 0 after the largest.
    pub frame_id: u32,
    /// The number of its first column in the frame, from 0. The others follow.
    pub measurement_id: u16,
    /// The time of the first valid column, or of the first column if none is valid: nanoseconds of
    /// the sensor's clock.
    pub time_ns: u64,
    /// Columns in a turn.
    pub columns_per_frame: u16,
    /// Columns in this packet, 64 at most.
    pub columns: u16,
    /// The valid columns as bits, the first column lowest.
    pub valid: u64,
    /// The duration of all columns at the nominal rate, microseconds.
    pub duration_us: f64,
}

/// Decodes packets of one sensor.
#[derive(Clone, Debug)]
pub struct Decoder {
    metadata: Metadata,
    layout: Layout,
    /// By row.
    beams: Vec<Beam>,
}

/// Sizes in bytes.
#[derive(Clone, Copy, Debug)]
struct Layout {
    packet: usize,
    header: usize,
    column: usize,
    column_header: usize,
    pixel: usize,
    /// The offset of a column's valid bit.
    status: usize,
}

/// A row of pixels.
#[derive(Clone, Copy, Debug)]
struct Beam {
    /// Its ring, from the lowest altitude.
    ring: u16,
    /// Its direction in the lidar frame while the encoder is at 0, of length 1.
    direction: [f64; 3],
}

impl Profile {
    /// Bytes of a pixel.
    fn pixel(self) -> usize {
        match self {
            Self::Legacy | Self::Single => 12,
            Self::Dual => 16,
            Self::LowRate => 4,
        }
    }

    /// Range in millimetres, 0 for none, and reflectivity of a pixel's returns.
    fn returns(self, pixel: &[u8]) -> [(u32, u8); 2] {
        let word = |at: usize| {
            u32::from_le_bytes([pixel[at], pixel[at + 1], pixel[at + 2], pixel[at + 3]])
        };
        match self {
            Self::Legacy => [(word(0) & 0xf_ffff, pixel[4]), (0, 0)],
            Self::Single => [(word(0) & 0x7_ffff, pixel[4]), (0, 0)],
            Self::Dual => [0, 4].map(|at| (word(at) & 0x7_ffff, pixel[at + 3])),
            Self::LowRate => [((word(0) & 0x7fff) * 8, pixel[2]), (0, 0)],
        }
    }
}

impl Layout {
    fn new(metadata: &Metadata) -> Self {
        let is_legacy = metadata.profile == Profile::Legacy;
        let [around, column_header, column_footer] =
            if is_legacy { [0, 16, 4] } else { [32, 12, 0] };
        let pixel = metadata.profile.pixel();
        let pixels = metadata.beams_deg.len() * pixel;
        let column = column_header + pixels + column_footer;
        Self {
            packet: usize::from(metadata.columns_per_packet) * column + 2 * around,
            header: around,
            column,
            column_header,
            pixel,
            status: if is_legacy { column_header + pixels } else { 10 },
        }
    }
}

impl Decoder {
    /// A decoder for packets of the sensor with these `metadata`.
    #[must_use]
    pub fn new(metadata: &Metadata) -> Self {
        let mut beams: Vec<_> =
            metadata.beams_deg.iter().map(|&angles| Beam::new(angles)).collect();
        // Rows are listed from above: of two with the same altitude, the later one is lower.
        let mut rising: Vec<_> = (0..beams.len()).rev().collect();
        let altitude = |&row: &usize| metadata.beams_deg[row][0];
        rising.sort_by(|a, b| altitude(a).total_cmp(&altitude(b)));
        for (row, ring) in rising.into_iter().zip(0..) {
            beams[row].ring = ring;
        }
        Self { metadata: metadata.clone(), layout: Layout::new(metadata), beams }
    }

    /// The length of the sensor's lidar packets, bytes.
    #[must_use]
    pub fn packet_size(&self) -> usize {
        self.layout.packet
    }

    /// Columns of each packet.
    #[must_use]
    pub fn columns(&self) -> u16 {
        self.metadata.columns_per_packet
    }

    /// The altitudes of the rows by ring, ascending, radians.
    #[must_use]
    pub fn elevations_rad(&self) -> Vec<f32> {
        let rows = self.metadata.beams_deg.iter();
        let mut elevations: Vec<_> =
            rows.map(|[altitude, _]| altitude.to_radians() as f32).collect();
        elevations.sort_by(f32::total_cmp);
        elevations
    }

    /// The header of `payload`.
    ///
    /// # Errors
    /// If it is not a lidar packet of this sensor.
    pub fn header(&self, payload: &[u8]) -> Result<Header, PacketError> {
        let (expected, found) = (self.layout.packet, payload.len());
        if found != expected {
            return Err(PacketError::Length { expected, found });
        }
        let frame_id = match (self.metadata.profile, self.metadata.is_fusa) {
            (Profile::Legacy, _) => u32::from(u16_at(payload, 10)),
            (_, _) if payload[0] != 1 => return Err(PacketError::Type(payload[0])),
            (_, false) => u32::from(u16_at(payload, 2)),
            (_, true) => u32::from(u16_at(payload, 4)) | u32::from(u16_at(payload, 6)) << 16,
        };
        let Metadata { columns_per_frame: per_frame, columns_per_packet, .. } = self.metadata;
        let measurement_id = u16_at(payload, self.layout.header + 8);
        let mut valid = 0u64;
        for (column, bytes) in self.columns_of(payload).enumerate() {
            if bytes[self.layout.status] & 1 == 0 {
                continue;
            }
            let (expected, found) = (usize::from(measurement_id) + column, u16_at(bytes, 8));
            if usize::from(found) != expected || found >= per_frame {
                return Err(PacketError::Measurement { column, expected, per_frame, found });
            }
            valid |= 1 << column;
        }
        let first_valid = if valid == 0 { 0 } else { valid.trailing_zeros() as usize };
        let turn_us = 1e6 / self.metadata.rate_hz;
        Ok(Header {
            frame_id,
            measurement_id,
            time_ns: time_ns(&payload[self.layout.header + first_valid * self.layout.column..]),
            columns_per_frame: per_frame,
            columns: columns_per_packet,
            valid,
            duration_us: turn_us * f64::from(columns_per_packet) / f64::from(per_frame),
        })
    }

    /// Passes each return of `payload` to `each`, by column and then by row. Pixels without a range
    /// and invalid columns have no returns.
    ///
    /// # Errors
    /// If it is not a lidar packet of this sensor; `each` is not called then.
    pub fn decode(
        &self,
        payload: &[u8],
        mut each: impl FnMut(&Return),
    ) -> Result<Header, PacketError> {
        let header = self.header(payload)?;
        for (i, column) in self.columns_of(payload).enumerate() {
            if header.valid >> i & 1 == 0 {
                continue;
            }
            let pose = self.sensor_from_column(usize::from(header.measurement_id) + i);
            let after_us = time_ns(column).saturating_sub(header.time_ns) as f64 * 1e-3;
            let pixels = column[self.layout.column_header..].chunks_exact(self.layout.pixel);
            for (beam, pixel) in self.beams.iter().zip(pixels) {
                let returns = self.metadata.profile.returns(pixel);
                for ((range, reflectivity), kind) in
                    returns.into_iter().zip([Kind::Strongest, Kind::Second])
                {
                    if range != 0 {
                        let range = f64::from(range) * RANGE_UNIT_M;
                        each(&Return {
                            point_m: self.point(&pose, beam, range).map(|x| x as f32),
                            range_m: range as f32,
                            ring: beam.ring,
                            reflectivity,
                            after_us,
                            kind,
                        });
                    }
                }
            }
        }
        Ok(header)
    }

    fn columns_of<'a>(&self, payload: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
        let n = usize::from(self.metadata.columns_per_packet);
        payload[self.layout.header..].chunks_exact(self.layout.column).take(n)
    }

    /// The transform from the lidar frame, turned with the encoder, to the sensor's frame.
    fn sensor_from_column(&self, measurement: usize) -> [[f64; 4]; 3] {
        let turns = measurement as f64 / f64::from(self.metadata.columns_per_frame);
        // The head turns clockwise.
        let (sin, cos) = libm::sincos(-std::f64::consts::TAU * turns);
        self.metadata
            .lidar_to_sensor
            .map(|[x, y, z, shift]| [x * cos + y * sin, y * cos - x * sin, z, shift])
    }

    /// The point of a return, metres.
    fn point(&self, pose: &[[f64; 4]; 3], beam: &Beam, range: f64) -> [f64; 3] {
        let [x, z] = self.metadata.origin_m;
        // The sensor reports ranges from the origin of the lidar frame.
        let along = range - if z == 0.0 { x } else { libm::hypot(x, z) };
        let [dx, dy, dz] = beam.direction.map(|component| along * component);
        pose.map(|row| row[0] * (dx + x) + row[1] * dy + row[2] * (dz + z) + row[3])
    }
}

impl Beam {
    fn new([altitude, azimuth]: [f64; 2]) -> Self {
        let (sin_altitude, flat) = libm::sincos(altitude.to_radians());
        let (sin, cos) = libm::sincos(azimuth.to_radians());
        Self { ring: 0, direction: [flat * cos, -flat * sin, sin_altitude] }
    }
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn time_ns(column: &[u8]) -> u64 {
    (0..4).map(|i| u64::from(u16_at(column, 2 * i)) << (16 * i)).sum()
}
