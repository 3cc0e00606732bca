//! The supported sensors.

use std::f64::consts::TAU;
use std::mem::discriminant;

use formats::returns::Return;
use formats::vlp32c::SEQUENCE_US;
use formats::{ouster, velodyne};

/// Why a payload is not the sensor's data, or its time is doubtful.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// An error of a Velodyne packet.
    #[error(transparent)]
    Velodyne(#[from] velodyne::PacketError),
    /// An error of an Ouster packet.
    #[error(transparent)]
    Ouster(#[from] ouster::PacketError),
    /// The times of a recording contradict the sensor's stamps. Its packets are used nonetheless.
    #[error(
        "by the times of the recording, {recorded_s:.3} s have passed since the first packet, and by \
         the sensor's stamps {stamped_s:.3} s: the stamps are used"
    )]
    Times {
        /// The time since the first packet by the recording, seconds.
        recorded_s: f64,
        /// The same by the stamps.
        stamped_s: f64,
    },
}

impl Flaw {
    /// Whether it is data of another sensor.
    pub(super) fn is_of_another_model(&self) -> bool {
        matches!(self, Self::Velodyne(velodyne::PacketError::OtherModel { .. }))
    }

    /// Whether the other flaw is of the same kind.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Velodyne(a), Self::Velodyne(b)) => discriminant(a) == discriminant(b),
            (Self::Ouster(a), Self::Ouster(b)) => discriminant(a) == discriminant(b),
            (Self::Times { .. }, Self::Times { .. }) => true,
            _ => false,
        }
    }
}

/// Decodes the packets of one sensor.
pub enum Decoder {
    /// A VLP-16 or VLP-32C.
    Velodyne(velodyne::Decoder),
    /// An OS0, OS1 or OS2.
    Ouster {
        decoder: Box<ouster::Decoder>,
        /// The yaw of the lidar in the sensor's frame, radians counterclockwise.
        yaw_rad: f64,
        /// The packets of each turn that are not sent, because their columns are outside of the
        /// azimuth window.
        n_unsent: u64,
        /// The first column of the packet before.
        before: u16,
    },
}

/// The header of a packet, for all sensors.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    pub stamp_us: f64,
    /// The duration of its firings, microseconds.
    pub duration_us: f64,
    /// The azimuth of the head at its first firing, radians clockwise from x.
    pub azimuth_rad: f64,
    /// The speed of the head, radians per microsecond.
    pub speed_rad_us: f64,
    /// The packets between the previous one and this that the sensor does not send.
    pub n_unsent: u64,
}

impl Decoder {
    /// A decoder for the sensor of `metadata`, or else for the Velodyne that sent `payload`.
    pub fn new(metadata: Option<&ouster::Metadata>, payload: &[u8]) -> Result<Self, Flaw> {
        let Some(metadata) = metadata else {
            let header = velodyne::Header::parse(payload)?;
            return Ok(Self::Velodyne(velodyne::Decoder::new(header.model)));
        };
        let decoder = Box::new(ouster::Decoder::new(metadata));
        let before = decoder.header(payload)?.measurement_id;
        let unsent = metadata.n_columns_unsent() / metadata.columns_per_packet();
        let yaw_rad = metadata.yaw_rad();
        Ok(Self::Ouster { decoder, yaw_rad, n_unsent: unsent.into(), before })
    }

    pub fn decode(&mut self, payload: &[u8], returns: &mut Vec<Return>) -> Result<Facts, Flaw> {
        returns.clear();
        match self {
            Self::Velodyne(decoder) => {
                let header = decoder.decode(payload, |found| returns.push(*found))?;
                Ok(Facts {
                    stamp_us: f64::from(header.time_us),
                    duration_us: header.duration_us(),
                    azimuth_rad: f64::from(header.azimuth) * UNIT_RAD,
                    speed_rad_us: header.units_per_us * UNIT_RAD,
                    n_unsent: 0,
                })
            }
            Self::Ouster { decoder, yaw_rad, n_unsent, before } => {
                let header = decoder.decode(payload, |found| returns.push(*found))?;
                let column_rad = TAU / f64::from(header.columns_per_frame);
                let is_new_turn = header.measurement_id < *before;
                *before = header.measurement_id;
                Ok(Facts {
                    stamp_us: header.time_ns as f64 * 1e-3,
                    duration_us: header.duration_us,
                    azimuth_rad: f64::from(header.measurement_id) * column_rad - *yaw_rad,
                    speed_rad_us: f64::from(header.columns) * column_rad / header.duration_us,
                    n_unsent: if is_new_turn { *n_unsent } else { 0 },
                })
            }
        }
    }

    /// The largest azimuth offset of a beam from the head, radians.
    pub fn most_offset_rad(&self) -> f64 {
        match self {
            Self::Velodyne(decoder) => decoder.most_offset_rad(),
            Self::Ouster { decoder, .. } => decoder.most_offset_rad(),
        }
    }

    pub fn elevations_deg(&self) -> Vec<f32> {
        let radians = match self {
            Self::Velodyne(decoder) => decoder.elevations_rad(),
            Self::Ouster { decoder, .. } => decoder.elevations_rad(),
        };
        radians.into_iter().map(f32::to_degrees).collect()
    }

    /// The period of the time stamps in microseconds; `None` if they practically never wrap around.
    pub fn wraps_us(&self) -> Option<f64> {
        match self {
            // Velodyne counts microseconds past the hour.
            Self::Velodyne(_) => Some(3.6e9),
            Self::Ouster { .. } => None,
        }
    }

    /// The azimuth step from one firing of all beams to the next, radians.
    pub fn step_rad(&self, facts: &Facts) -> f64 {
        let step_us = match self {
            Self::Velodyne(_) => SEQUENCE_US,
            Self::Ouster { decoder, .. } => facts.duration_us / f64::from(decoder.columns()),
        };
        step_us * facts.speed_rad_us
    }
}

/// The unit of a Velodyne's azimuths, radians.
const UNIT_RAD: f64 = TAU / 36_000.0;
