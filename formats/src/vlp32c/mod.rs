//! Writes scans as the data packets of a Velodyne VLP-32C in a capture, which drivers of the sensor
//! decode, and [`crate::velodyne`] as well.
//!
//! Layout and timing: VLP-32C User Manual 63-9325, chapter 9. A packet's 1206
//! bytes, little-endian, are sent to UDP port 2368:
//!
//! | bytes | contents |
//! | --- | --- |
//! | 12 x 100 | blocks: `FF EE`, azimuth u16 in 0.01 degree, then for each laser distance u16 in 4 mm and reflectivity u8 |
//! | 4 | firing time of the first block, microseconds past the hour |
//! | 1 | returns: `37` strongest, `38` last, `39` both |
//! | 1 | `28`, the model |
//!
//! A block is one firing sequence of 55.296 us: lasers 0 to 31, two at a time,
//! 2.304 us apart. With both returns each sequence has two blocks: the last return,
//! and the strongest one or, if the last is the strongest, the second strongest. With
//! a single return they are identical (p. 57). A beam without a return has distance 0.
//! All sequences are written, from azimuth 0 to the end of the revolution; sequences
//! without returns fill the last packet.
//!
//! # Decoding
//!
//! Laser l, at azimuth offset a and elevation e, with distance r in a block of
//! azimuth A, that fires t after the block's start while the head turns at w:
//!
//! ```text
//! azimuth = A + w t - a                    clockwise from x
//! x =  r cos(e) cos(azimuth)
//! y = -r cos(e) sin(azimuth)
//! z =  r sin(e) - 0.0424 m x tan(e)        beams cross 42.4 mm off the axis
//! ```
//!
//! Distances are measured from (0, 0, -0.0424 m x tan(e)) on the axis. A scan whose
//! beams were cast from there, at azimuths A + w t - a with a whole A, is decoded
//! with rounding errors only:
//!
//! - range: half a unit, 2 mm;
//! - azimuth: a decoder rounds A + w t to 0.01 degree, an error of half a unit. It
//!   also takes w from the azimuths of the packet's first and last block, each with
//!   an error of half a unit; over t, at most 34.56 us of the 11 (5 with both
//!   returns) sequences between them, that is 0.057 (0.125) unit. The sum is
//!   0.0056 (0.0063) degree.
//!
//! A scan whose beams were cast from a single point could not be decoded so: a line
//! that starts 20 mm lower does not reach the same point.

pub(crate) mod packet;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

#[cfg(feature = "dataset")]
use crate::atomic;
use crate::atomic::Unfinished;
use crate::error::FormatError;
#[cfg(feature = "dataset")]
use crate::hash::{FileHash, Hashing};
use crate::pcap::{self, Origin};
use crate::scan::{Attribute, Scan};
use packet::{BLOCKS, LASERS, Measurement, Sequence};

/// Time between two firing sequences, microseconds.
pub const SEQUENCE_US: f64 = 55.296;

/// Firing sequences of a packet that holds one return of each beam.
pub const SEQUENCES_PER_PACKET: u32 = BLOCKS as u32;

/// The period of the time stamps, microseconds.
pub(crate) const HOUR_US: u64 = 3_600_000_000;

/// The unit of distances, metres.
pub const DISTANCE_UNIT_M: f64 = 0.004;

/// The largest distance in a packet, metres.
pub const FARTHEST_M: f64 = u16::MAX as f64 * DISTANCE_UNIT_M;

/// The unit of azimuths, degrees.
pub const AZIMUTH_UNIT_DEG: f64 = 0.01;

const UNITS_PER_TURN: f64 = 360.0 / AZIMUTH_UNIT_DEG;

/// Distance from the axis at which all beams cross, metres: velodyne-decoder 3.1.0 corrects the z of
/// its points by it.
pub const BEAM_CROSSING_M: f64 = 0.0424;

/// The start of every revolution, so that the same scan gives the same bytes: 2000-01-01, 00:00:00 UTC, in
/// Unix time.
pub const START_S: u32 = 946_684_800;

/// The reflectivity of every return of a scan without intensity: a white
/// surface that scatters all light.
pub const WHITE: u8 = 100;

/// A sensor with its factory settings: its IP address, and a MAC address of its maker.
const SENSOR: Origin =
    Origin { mac: [0x60, 0x76, 0x88, 0, 0, 0], ip: [192, 168, 1, 201], port: 2368 };

/// One turn of the sensor's head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Revolution {
    /// Revolutions per minute, above 0.
    pub rpm: f64,
    /// Beams that were fired. The last sequence may be incomplete.
    pub n_beams: u32,
}

crate::named! {
    /// The returns of a beam that a sensor sends.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Returns: "return mode" {
        /// The strongest, which is the sensor's default.
        #[default]
        Strongest = "strongest",
        /// The last.
        Last = "last",
        /// The last and the strongest, or the second strongest if the last is the strongest: two
        /// blocks for each sequence.
        Dual = "dual",
    }
}

impl Revolution {
    /// Firing sequences. The last may be incomplete.
    #[must_use]
    pub fn sequences(&self) -> u32 {
        self.n_beams.div_ceil(LASERS as u32)
    }

    /// The encoder's azimuth at the start of `sequence`, units of 0.01 degree.
    #[must_use]
    pub fn azimuth(&self, sequence: u32) -> u16 {
        let turned = f64::from(sequence) * SEQUENCE_US * 1e-6 * self.rpm / 60.0;
        (turned * UNITS_PER_TURN).round().rem_euclid(UNITS_PER_TURN) as u16
    }
}

impl Returns {
    /// Blocks for each firing sequence.
    pub(crate) fn blocks_per_sequence(self) -> usize {
        if self == Self::Dual { 2 } else { 1 }
    }

    fn byte(self) -> u8 {
        match self {
            Self::Strongest => 0x37,
            Self::Last => 0x38,
            Self::Dual => 0x39,
        }
    }

    pub(crate) fn of_byte(byte: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|returns| returns.byte() == byte)
    }
}

/// Writes the packets of one `revolution` to `path`, atomically, and returns the
/// hash of the file that `hashing` asks for.
///
/// `scan` needs the beam and the range of each point; beam b is laser b % 32 of sequence b / 32.
/// Positions are ignored. Reflectivities are written unchanged: 0 to 100 for surfaces that
/// scatter 0 to 100 % of the light, 101 to 255 for retro-reflectors (VLP-32C User Manual 63-9325,
/// 6.1). Without reflectivities, intensities become reflectivities of 0 to 100; without either, all
/// are [`WHITE`]. A range that is not finite, below half a unit or beyond [`FARTHEST_M`] gives no
/// return. With both returns a beam may have two points, the second of which is the last return.
///
/// # Errors
/// A scan without beams or ranges, with a beam outside the revolution, or with more points than
/// returns of a beam; an attribute of another length than the positions; errors of the
/// system.
#[cfg(feature = "dataset")]
pub fn write(
    path: &Path,
    hashing: Hashing,
    revolution: &Revolution,
    returns: Returns,
    scan: &Scan,
) -> Result<Option<FileHash>, FormatError> {
    let sequences_per_packet = BLOCKS / returns.blocks_per_sequence();
    let fired = measurements(path, revolution, returns, scan)?;
    atomic::write_hashed(path, hashing, |writer| {
        pcap::write_header(writer)?;
        for (number, fired) in (0..).zip(fired.chunks(sequences_per_packet)) {
            let first = number * sequences_per_packet as u32;
            write_packet(writer, START_S, revolution, returns, first, fired)?;
        }
        writer.flush()
    })
}

fn write_packet(
    writer: &mut impl Write,
    start_s: u32,
    revolution: &Revolution,
    returns: Returns,
    first: u32,
    fired: &[Sequence],
) -> io::Result<()> {
    let time_us = (f64::from(first) * SEQUENCE_US).round() as u64;
    let azimuth = |i: usize| revolution.azimuth(first + i as u32);
    // The start is a whole hour.
    let payload = packet::payload(returns, (time_us % HOUR_US) as u32, azimuth, fired);
    let stamp = [start_s + (time_us / 1_000_000) as u32, (time_us % 1_000_000) as u32];
    pcap::write_packet(writer, &SENSOR, stamp, &payload)
}

/// Writes the capture of a sensor that keeps turning, piece by piece. The file gets its name when it is
/// finished.
pub struct Capture {
    file: Unfinished,
    path: PathBuf,
    start_s: u32,
    piece: Revolution,
    returns: Returns,
    sequences: u32,
}

impl Capture {
    /// Begins the capture at `path` of a sensor that turns `rpm` times per minute and sends these
    /// `returns`, from `start_s` in Unix time, a whole hour.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn create(
        path: &Path,
        start_s: u32,
        rpm: f64,
        returns: Returns,
    ) -> Result<Self, FormatError> {
        let mut file = Unfinished::create(path)?;
        file.append(pcap::write_header)?;
        let piece = Revolution { rpm, n_beams: SEQUENCES_PER_PACKET * LASERS as u32 };
        Ok(Self { file, path: path.to_path_buf(), start_s, piece, returns, sequences: 0 })
    }

    /// Appends the next [`SEQUENCES_PER_PACKET`] firing sequences, as `write` does: beam b of `scan`
    /// is laser b % 32 of sequence b / 32 of these. With both returns they are two packets.
    ///
    /// # Errors
    /// As `write`.
    pub fn push(&mut self, scan: &Scan) -> Result<(), FormatError> {
        let Self { start_s, piece, returns, .. } = *self;
        let sequences_per_packet = BLOCKS / returns.blocks_per_sequence();
        for fired in measurements(&self.path, &piece, returns, scan)?.chunks(sequences_per_packet) {
            let first = self.sequences;
            self.file
                .append(|writer| write_packet(writer, start_s, &piece, returns, first, fired))?;
            self.sequences += fired.len() as u32;
        }
        Ok(())
    }

    /// Completes the capture.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn finish(self) -> Result<(), FormatError> {
        self.file.finish()
    }
}

fn measurements(
    path: &Path,
    revolution: &Revolution,
    returns: Returns,
    scan: &Scan,
) -> Result<Vec<Sequence>, FormatError> {
    scan.check_lengths()?;
    let missing = |attribute: Attribute| FormatError::Length {
        attribute: attribute.name(),
        expected: scan.len(),
        found: 0,
    };
    let beams = scan.beam.as_ref().ok_or_else(|| missing(Attribute::Beam))?;
    let ranges_m = scan.range_m.as_ref().ok_or_else(|| missing(Attribute::Range))?;
    let most = returns.blocks_per_sequence() as u8;
    let mut told = vec![0; revolution.n_beams as usize];
    let mut fired = vec![Sequence::NONE; revolution.sequences() as usize];
    for (i, (&beam, &range_m)) in beams.iter().zip(ranges_m).enumerate() {
        if beam >= revolution.n_beams {
            let cause = format!("{beam} of {} in a revolution", revolution.n_beams);
            return Err(FormatError::malformed(path, "beam", cause));
        }
        let reflectivity = match (&scan.reflectivity, &scan.intensity) {
            (Some(bytes), _) => bytes[i],
            (None, Some(values)) => percent(values[i]),
            (None, None) => WHITE,
        };
        let (sequence, laser) = (beam as usize / LASERS, beam as usize % LASERS);
        let Sequence { last, other } = &mut fired[sequence];
        if told[beam as usize] == most {
            let cause = format!("{beam} has more points than the {most} of \"{returns}\"");
            return Err(FormatError::malformed(path, "beam", cause));
        }
        let measured = Measurement::new(range_m, reflectivity);
        // The nearer of two points comes first; a single point is both returns.
        if told[beam as usize] == 0 {
            other[laser] = measured;
        }
        last[laser] = measured;
        told[beam as usize] += 1;
    }
    Ok(fired)
}

/// An intensity of 0 to 1 as a reflectivity of 0 to 100; NaN is 0.
fn percent(intensity: f32) -> u8 {
    (intensity.clamp(0.0, 1.0) * f32::from(WHITE)).round() as u8
}
