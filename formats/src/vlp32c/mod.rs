//! Scans as a Velodyne VLP-32C sends them: data packets in a capture, which any
//! driver of the sensor decodes, [`crate::velodyne`] among them.
//!
//! Layout and timing: VLP-32C User Manual 63-9325, chapter 9. A packet's 1206
//! bytes, little-endian, are sent to UDP port 2368:
//!
//! | bytes | what |
//! | --- | --- |
//! | 12 x 100 | blocks: `FF EE`, azimuth u16 in 0.01 degree, then for each laser distance u16 in 4 mm and reflectivity u8 |
//! | 4 | microseconds past the hour at which the first block was fired |
//! | 1 | returns: `37` strongest, `38` last, `39` both |
//! | 1 | `28`, the model |
//!
//! A block is one firing sequence of 55.296 us: lasers 0 to 31, two at a time,
//! 2.304 us apart. With both returns each sequence has two blocks, of the last
//! and of the strongest return, or of the second strongest where the strongest is the last;
//! where there is but one, they are identical (p. 57). A beam that saw nothing has distance 0. Sequences
//! are written whether or not they saw something, from the one at azimuth 0 to
//! the end of the revolution, and on to the end of the last packet without
//! returns.
//!
//! # What a decoder makes of it
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
//! So distance counts from (0, 0, -0.0424 m x tan(e)) on the axis, and a scan
//! whose beams were cast from there, at azimuths that are A + w t - a for a
//! whole A, comes back but for the roundings:
//!
//! - range: half a unit, 2 mm;
//! - azimuth: a decoder rounds A + w t to 0.01 degree, which is off by half of
//!   that, and takes w from the azimuths of the packet's first and last block,
//!   each off by half a unit, as well. Over t, 34.56 us at most, of the 11 (5 with
//!   both returns) sequences between them that is 0.057 (0.125) unit. Together
//!   0.0056 (0.0063) degree.
//!
//! A scan that was cast from one point could not come back: no range along a
//! line that starts 20 mm lower ends at the same point.

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
use crate::pcap::{self, Sender};
use crate::scan::{Attribute, Scan};
use packet::{BLOCKS, LASERS, Measurement, Sequence};

/// From one firing sequence to the next, microseconds.
pub const SEQUENCE_US: f64 = 55.296;

/// Firing sequences of a packet that holds one return of each beam.
pub const SEQUENCES_PER_PACKET: u32 = BLOCKS as u32;

const HOUR_US: u64 = 3_600_000_000;

/// The unit of distances, metres.
pub const DISTANCE_UNIT_M: f64 = 0.004;

/// The farthest distance that a packet can tell, metres.
pub const FARTHEST_M: f64 = u16::MAX as f64 * DISTANCE_UNIT_M;

/// The unit of azimuths, degrees.
pub const AZIMUTH_UNIT_DEG: f64 = 0.01;

const UNITS_PER_TURN: f64 = 360.0 / AZIMUTH_UNIT_DEG;

/// All beams cross this far in front of the axis, metres: what velodyne-decoder
/// 3.1.0 takes off its points' z.
pub const BEAM_CROSSING_M: f64 = 0.0424;

/// When every revolution and capture starts: 2000-01-01, 00:00:00 UTC, in Unix time, so
/// that the same scan gives the same bytes.
pub const START_S: u32 = 946_684_800;

/// The reflectivity of every return of a scan without intensity: a white
/// surface that scatters all light.
pub const WHITE: u8 = 100;

/// A sensor as it leaves the factory: its address, and a MAC of its maker's.
const SENSOR: Sender =
    Sender { mac: [0x60, 0x76, 0x88, 0, 0, 0], ip: [192, 168, 1, 201], port: 2368 };

/// One turn of the sensor's head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Revolution {
    /// Revolutions per minute, above 0.
    pub rpm: f64,
    /// Beams that were fired; the last sequence may be cut short.
    pub n_beams: u32,
}

crate::named! {
    /// Which returns of a beam a sensor sends.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Returns: "return mode" {
        /// The strongest, as sensors do by default.
        #[default]
        Strongest = "strongest",
        /// The last.
        Last = "last",
        /// The last and the strongest, or the second strongest where the strongest is the
        /// last: two blocks of each sequence.
        Dual = "dual",
    }
}

impl Revolution {
    /// Firing sequences, the last of which may be cut short.
    #[must_use]
    pub fn sequences(&self) -> u32 {
        self.n_beams.div_ceil(LASERS as u32)
    }

    /// What the encoder reads when `sequence` starts, units of 0.01 degree.
    #[must_use]
    pub fn azimuth(&self, sequence: u32) -> u16 {
        self.units(sequence).rem_euclid(UNITS_PER_TURN) as u16
    }

    /// How often the encoder has passed 0 when `sequence` of a sensor that keeps turning starts,
    /// by what it reads then.
    #[must_use]
    pub fn turn(&self, sequence: u32) -> u32 {
        (self.units(sequence) / UNITS_PER_TURN) as u32
    }

    /// Whole units of azimuth since sequence 0.
    fn units(&self, sequence: u32) -> f64 {
        let turned = f64::from(sequence) * SEQUENCE_US * 1e-6 * self.rpm / 60.0;
        (turned * UNITS_PER_TURN).round()
    }
}

impl Returns {
    /// Blocks of each firing sequence.
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
/// `scan` has the beam and the range of each point, beam b being laser b % 32
/// of sequence b / 32; positions are not looked at. A reflectivity is written as
/// it is: 0 to 100 for surfaces that scatter 0 to 100 % of the light, 101 to 255 for
/// retro-reflectors (VLP-32C User Manual 63-9325, 6.1). Without one an intensity becomes a
/// reflectivity of 0 to 100, and without either it is [`WHITE`]. A range that is not finite,
/// below half a unit or beyond [`FARTHEST_M`] is no return. With both returns a beam may have
/// two points, of which the second is the last return.
///
/// # Errors
/// A scan without beams or ranges, or with a beam beyond the revolution's or with more points
/// than a beam has returns; an attribute of another length than the positions; what the system
/// reports.
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
            write_packet(writer, revolution, returns, first, fired)?;
        }
        writer.flush()
    })
}

/// Writes the packet that begins with sequence `first`.
fn write_packet(
    writer: &mut impl Write,
    revolution: &Revolution,
    returns: Returns,
    first: u32,
    fired: &[Sequence],
) -> io::Result<()> {
    let time_us = (f64::from(first) * SEQUENCE_US).round() as u64;
    let azimuth = |i: usize| revolution.azimuth(first + i as u32);
    // START_S is a whole hour.
    let payload = packet::payload(returns, (time_us % HOUR_US) as u32, azimuth, fired);
    let stamp = [START_S + (time_us / 1_000_000) as u32, (time_us % 1_000_000) as u32];
    pcap::write_packet(writer, &SENSOR, stamp, &payload)
}

/// A capture of a sensor that keeps turning, written piece by piece. It appears under its name once it is finished.
pub struct Capture {
    file: Unfinished,
    path: PathBuf,
    piece: Revolution,
    returns: Returns,
    sequences: u32,
}

impl Capture {
    /// Begins the capture at `path` of a sensor that turns `rpm` times a minute and tells these
    /// `returns`.
    ///
    /// # Errors
    /// What the system reports.
    pub fn create(path: &Path, rpm: f64, returns: Returns) -> Result<Self, FormatError> {
        let mut file = Unfinished::create(path)?;
        file.append(pcap::write_header)?;
        let piece = Revolution { rpm, n_beams: SEQUENCES_PER_PACKET * LASERS as u32 };
        Ok(Self { file, path: path.to_path_buf(), piece, returns, sequences: 0 })
    }

    /// Appends the next [`SEQUENCES_PER_PACKET`] firing sequences, as `write` does: beam b
    /// of `scan` is laser b % 32 of their sequence b / 32. With both returns they are two
    /// packets.
    ///
    /// # Errors
    /// As `write`.
    pub fn push(&mut self, scan: &Scan) -> Result<(), FormatError> {
        let Self { piece, returns, .. } = *self;
        let sequences_per_packet = BLOCKS / returns.blocks_per_sequence();
        for fired in measurements(&self.path, &piece, returns, scan)?.chunks(sequences_per_packet) {
            let first = self.sequences;
            self.file.append(|writer| write_packet(writer, &piece, returns, first, fired))?;
            self.sequences += fired.len() as u32;
        }
        Ok(())
    }

    /// Gives the capture its name.
    ///
    /// # Errors
    /// What the system reports.
    pub fn finish(self) -> Result<(), FormatError> {
        self.file.finish()
    }
}

/// What each sequence measured.
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
            let cause = format!("{beam} has more points than the {most} that \"{returns}\" tells");
            return Err(FormatError::malformed(path, "beam", cause));
        }
        let measured = Measurement::new(range_m, reflectivity);
        // Of two the nearer comes first; one alone is both.
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
