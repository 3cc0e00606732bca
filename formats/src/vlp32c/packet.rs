//! Encodes one data packet.

use super::{DISTANCE_UNIT_M, Returns};

/// Lasers of the sensor, and measurements of a block.
pub(crate) const LASERS: usize = 32;
pub(crate) const BLOCKS: usize = 12;

/// Bytes of a block's flag and azimuth.
pub(crate) const BLOCK_HEADER_SIZE: usize = 4;
/// Bytes of a distance and a reflectivity.
pub(crate) const MEASUREMENT_SIZE: usize = 3;
pub(crate) const BLOCK_SIZE: usize = BLOCK_HEADER_SIZE + LASERS * MEASUREMENT_SIZE;
pub(crate) const PAYLOAD_SIZE: usize = BLOCKS * BLOCK_SIZE + 6;

/// The first bytes of each block.
pub(crate) const FLAG: [u8; 2] = [0xff, 0xee];
/// The last byte of a packet of a VLP-32C.
pub(crate) const MODEL: u8 = 0x28;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Measurement {
    /// Distance in units of [`DISTANCE_UNIT_M`]; 0 without a return.
    distance: u16,
    reflectivity: u8,
}

impl Measurement {
    pub const NONE: Self = Self { distance: 0, reflectivity: 0 };

    /// A return, or none if its range does not fit a packet.
    pub fn new(range_m: f32, reflectivity: u8) -> Self {
        let units = (f64::from(range_m) / DISTANCE_UNIT_M).round();
        // No range contains NaN.
        if (1.0..=f64::from(u16::MAX)).contains(&units) {
            Self { distance: units as u16, reflectivity }
        } else {
            Self::NONE
        }
    }
}

/// The measurements of a firing sequence, by laser.
#[derive(Clone)]
pub(super) struct Sequence {
    pub last: [Measurement; LASERS],
    /// The other return of dual returns, which equals the last if there is only one.
    pub other: [Measurement; LASERS],
}

impl Sequence {
    pub const NONE: Self =
        Self { last: [Measurement::NONE; LASERS], other: [Measurement::NONE; LASERS] };
}

/// A packet that begins at `time_us` past the hour. `azimuth` is the encoder's azimuth at the start of
/// the packet's i-th sequence. Sequences beyond those that were `fired` have no returns.
pub(super) fn payload(
    returns: Returns,
    time_us: u32,
    azimuth: impl Fn(usize) -> u16,
    fired: &[Sequence],
) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(PAYLOAD_SIZE);
    for block in 0..BLOCKS {
        let blocks_per_sequence = returns.blocks_per_sequence();
        let sequence = block / blocks_per_sequence;
        let Sequence { last, other } = fired.get(sequence).unwrap_or(&Sequence::NONE);
        // Blocks are counted from 0, as in the manual: even ones hold the last return.
        let measured = if block % blocks_per_sequence == 0 { last } else { other };
        bytes.extend(FLAG);
        bytes.extend(azimuth(sequence).to_le_bytes());
        for measurement in measured {
            bytes.extend(measurement.distance.to_le_bytes());
            bytes.push(measurement.reflectivity);
        }
    }
    bytes.extend(time_us.to_le_bytes());
    bytes.extend([returns.byte(), MODEL]);
    bytes
}
