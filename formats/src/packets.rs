//! Decodes the packets of the supported sensors.

use std::f64::consts::TAU;

use crate::returns::Return;
use crate::velodyne::{Sector, UnsentPackets};
use crate::{ouster, velodyne};

/// Why a payload is not the sensor's data.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PacketError {
    /// An error of a Velodyne packet.
    #[error(transparent)]
    Velodyne(#[from] velodyne::PacketError),
    /// An error of an Ouster packet.
    #[error(transparent)]
    Ouster(#[from] ouster::PacketError),
}

/// Decodes the packets of one sensor.
pub enum Decoder {
    /// A VLP-16 or VLP-32C.
    Velodyne {
        /// Its decoder.
        decoder: velodyne::Decoder,
        /// The packets that it does not send.
        unsent: UnsentPackets,
    },
    /// An OS0, OS1 or OS2.
    Ouster {
        /// Its decoder.
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
    /// The sensor's stamp, microseconds.
    pub stamp_us: f64,
    /// The duration of its firings, microseconds.
    pub duration_us: f64,
    /// The azimuth of the head at its first firing, radians clockwise from x.
    pub azimuth_rad: f64,
    /// The speed of the head, radians per microsecond.
    pub speed_rad_us: f64,
    /// The packets between the previous one and this that the sensor does not send.
    pub n_unsent: u64,
    /// Of packets before, those that seemed lost and that a Velodyne does not send, since they are missing
    /// again.
    pub n_unsent_before: u64,
    /// Where the packet goes on behind a sector that the sensor does not send: microseconds after its first
    /// firing, and the azimuth of the head, radians clockwise from x.
    pub resumes: Option<(f64, f64)>,
}

impl Decoder {
    /// A decoder for the sensor of `metadata`, or else for the Velodyne that sent `payload`.
    ///
    /// # Errors
    /// A payload that is not a packet of the sensor.
    pub fn new(metadata: Option<&ouster::Metadata>, payload: &[u8]) -> Result<Self, PacketError> {
        let Some(metadata) = metadata else {
            let header = velodyne::Header::parse(payload)?;
            let decoder = velodyne::Decoder::new(header.model);
            return Ok(Self::Velodyne { decoder, unsent: UnsentPackets::default() });
        };
        let decoder = Box::new(ouster::Decoder::new(metadata));
        let before = decoder.header(payload)?.measurement_id;
        let unsent = metadata.n_columns_unsent() / metadata.columns_per_packet;
        let yaw_rad = metadata.yaw_rad();
        Ok(Self::Ouster { decoder, yaw_rad, n_unsent: unsent.into(), before })
    }

    /// The same decoder, which knows that the sensor sends this sector only.
    pub(crate) fn of_sector(mut self, sector: &Sector) -> Self {
        if let Self::Velodyne { unsent, .. } = &mut self {
            *unsent = UnsentPackets::outside(sector);
        }
        self
    }

    /// Decodes a packet into `returns`.
    ///
    /// # Errors
    /// A payload that is not a packet of the sensor.
    pub fn decode(
        &mut self,
        payload: &[u8],
        returns: &mut Vec<Return>,
    ) -> Result<Facts, PacketError> {
        returns.clear();
        match self {
            Self::Velodyne { decoder, unsent } => {
                let header = decoder.decode(payload, |found| returns.push(*found))?;
                let [n_unsent, n_unsent_before] = unsent.take(&header);
                Ok(Facts {
                    stamp_us: f64::from(header.time_us),
                    duration_us: header.duration_us(),
                    azimuth_rad: f64::from(header.azimuth) * UNIT_RAD,
                    speed_rad_us: header.units_per_us * UNIT_RAD,
                    n_unsent,
                    n_unsent_before,
                    resumes: header
                        .resumes()
                        .map(|(us, azimuth)| (us, f64::from(azimuth) * UNIT_RAD)),
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
                    n_unsent_before: 0,
                    resumes: None,
                })
            }
        }
    }

    /// The elevations of its rings, degrees.
    #[must_use]
    pub fn elevations_deg(&self) -> Vec<f32> {
        let radians = match self {
            Self::Velodyne { decoder, .. } => decoder.elevations_rad(),
            Self::Ouster { decoder, .. } => decoder.elevations_rad(),
        };
        radians.into_iter().map(f32::to_degrees).collect()
    }

    /// The period of the time stamps in microseconds; `None` if they practically never wrap around.
    #[must_use]
    pub fn wraps_us(&self) -> Option<f64> {
        match self {
            // Velodyne counts microseconds past the hour.
            Self::Velodyne { .. } => Some(3.6e9),
            Self::Ouster { .. } => None,
        }
    }
}

/// The unit of a Velodyne's azimuths, radians.
const UNIT_RAD: f64 = TAU / 36_000.0;
