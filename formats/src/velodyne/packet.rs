//! Decodes one data packet.

use super::Model;
use super::model::Laser;
use crate::periodic::shorter_way;
use crate::returns::{Kind, Return};
use crate::vlp32c::packet::{
    BLOCK_HEADER_SIZE, BLOCK_SIZE, BLOCKS, FLAG, MEASUREMENT_SIZE, PAYLOAD_SIZE,
};
use crate::vlp32c::{AZIMUTH_UNIT_DEG, HOUR_US, Returns, SEQUENCE_US};

/// Azimuth units of a turn.
pub(super) const TURN: u16 = 36_000;

/// Longer steps are gaps, even if the head stands still, microseconds.
pub(super) const LONGEST_STEP_US: f64 = 1e6;

/// Why a payload is not a data packet.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PacketError {
    /// The payload has another length.
    #[error("expected a data packet of 1206 bytes, found {0} bytes")]
    Length(usize),
    /// The sensor is not supported.
    #[error("expected a packet of a VLP-16 (byte 0x22) or VLP-32C (0x28), found byte {0:#04x}")]
    Model(u8),
    /// The sensor is another one than that of the packets before.
    #[error("expected a packet of a {expected}, found one of a {found}")]
    OtherModel {
        /// The sensor of the packets before.
        expected: Model,
        /// The sensor of this packet.
        found: Model,
    },
    /// The byte of the return mode is unknown.
    #[error("expected the return mode 0x37, 0x38 or 0x39, found {0:#04x}")]
    Returns(u8),
    /// A block has no flag.
    #[error("block {0}: expected the flag ff ee")]
    Flag(usize),
    /// An azimuth exceeds a turn.
    #[error("block {block}: expected an azimuth below 36000, found {found}")]
    Azimuth {
        /// The block, from 0.
        block: usize,
        /// Its azimuth in units of 0.01 degree.
        found: u16,
    },
}

/// The header of a packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header {
    /// The sensor.
    pub model: Model,
    /// The returns that it sends.
    pub returns: Returns,
    /// Firing time of the first block, microseconds past the hour.
    pub time_us: u32,
    /// The encoder's azimuth at the first block, units of 0.01 degree.
    pub azimuth: u16,
    /// Rotation rate of the head, units of 0.01 degree per microsecond, from the packet's first and
    /// last azimuth. It is 0 if the head seems to turn backwards, as while it starts or stops.
    pub units_per_us: f64,
    /// Where the packet goes on behind a sector that the sensor does not send.
    jump: Option<Jump>,
}

/// Where a packet goes on behind a sector that the sensor does not send.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Jump {
    /// The first block, or pair of blocks with both returns, behind it.
    firing: usize,
    /// Its azimuth.
    azimuth: u16,
    /// How long the head turns through the sector, microseconds.
    us: f64,
}

/// Decodes packets of one sensor.
#[derive(Clone, Debug)]
pub struct Decoder {
    model: Model,
    lasers: Vec<Laser>,
}

impl Header {
    /// The header of `payload`.
    ///
    /// # Errors
    /// If it is not a data packet of a supported sensor.
    pub fn parse(payload: &[u8]) -> Result<Self, PacketError> {
        Self::of_blocks(payload, &blocks(payload)?)
    }

    /// The header of a payload with these blocks.
    fn of_blocks(payload: &[u8], blocks: &[&[u8]; BLOCKS]) -> Result<Self, PacketError> {
        let [.., a, b, c, d, mode, model] = *payload else {
            return Err(PacketError::Length(payload.len()));
        };
        let model = Model::of_byte(model).ok_or(PacketError::Model(model))?;
        let returns = Returns::of_byte(mode).ok_or(PacketError::Returns(mode))?;
        let mut firings = [0; BLOCKS];
        let own = blocks.chunks_exact(returns.blocks_per_sequence());
        let n_firings = own.len();
        firings.iter_mut().zip(own).for_each(|(firing, blocks)| *firing = azimuth(blocks[0]));
        let firings = &firings[..n_firings];
        let n_steps = (firings.len() - 1) as f64;
        let first = firings[0];
        let (turned, n_even, jump) = match find_jump(firings) {
            Some((firing, even)) => (even, n_steps - 1.0, Some(firing)),
            None => (advance(first, firings[firings.len() - 1]), n_steps, None),
        };
        let units_per_us = f64::from(turned) / (n_even * model.block_us());
        let jump = jump.map(|firing| {
            let jumped = forward(firings[firing - 1], firings[firing]);
            let us = f64::from(jumped) / units_per_us - model.block_us();
            Jump { firing, azimuth: firings[firing], us }
        });
        let time_us = u32::from_le_bytes([a, b, c, d]);
        Ok(Self { model, returns, time_us, azimuth: first, units_per_us, jump })
    }

    /// The number of its blocks, or of pairs of blocks with both returns.
    fn n_firings(&self) -> usize {
        BLOCKS / self.returns.blocks_per_sequence()
    }

    /// Time from the start of the packet's first firing sequence to the end of its last, microseconds.
    #[must_use]
    pub fn duration_us(&self) -> f64 {
        self.firing_us(self.n_firings())
    }

    /// The same without the time in which the sensor turns through what it does not send.
    #[must_use]
    pub fn sending_us(&self) -> f64 {
        self.n_firings() as f64 * self.model.block_us()
    }

    /// The time of a block, or pair of blocks with both returns, after the first, microseconds.
    fn firing_us(&self, number: usize) -> f64 {
        let pause_us = self.jump.filter(|jump| number >= jump.firing).map_or(0.0, |jump| jump.us);
        number as f64 * self.model.block_us() + pause_us
    }

    /// Within the packet, the azimuths from and to which the head turns without sending.
    pub(super) fn unsent(&self) -> Option<(u16, u16)> {
        let (from, width) = self.spans().next()?;
        self.jump.map(|jump| ((from + width) % TURN, jump.azimuth))
    }

    /// Where the packet goes on behind a sector that the sensor does not send: microseconds after its
    /// start, and the azimuth.
    pub(crate) fn resumes(&self) -> Option<(f64, u16)> {
        self.jump.map(|jump| (self.firing_us(jump.firing), jump.azimuth))
    }

    /// The azimuth at its end.
    pub(super) fn end(&self) -> u16 {
        self.spans().last().map_or(self.azimuth, |(from, width)| (from + width) % TURN)
    }

    /// The azimuths over which it fires: where each span begins, and its width.
    pub(super) fn spans(&self) -> impl Iterator<Item = (u16, u16)> {
        let step = self.units_per_us * self.model.block_us();
        let width = move |n: usize| (n as f64 * step).ceil() as u16;
        let n_before = self.jump.map_or(self.n_firings(), |jump| jump.firing);
        let behind = self.jump.map(|jump| (jump.azimuth, width(self.n_firings() - jump.firing)));
        [(self.azimuth, width(n_before))].into_iter().chain(behind)
    }
}

impl Decoder {
    /// A decoder for packets of `model`.
    #[must_use]
    pub fn new(model: Model) -> Self {
        Self { model, lasers: model.lasers() }
    }

    /// The sensor.
    #[must_use]
    pub fn model(&self) -> Model {
        self.model
    }

    /// The elevations of its lasers by ring, ascending, radians.
    #[must_use]
    pub fn elevations_rad(&self) -> Vec<f32> {
        let elevation =
            |laser: &Laser| libm::atan2(laser.sin_elevation, laser.cos_elevation) as f32;
        let mut elevations: Vec<_> = self.lasers.iter().map(elevation).collect();
        elevations.sort_by(f32::total_cmp);
        elevations
    }

    /// Passes each return of `payload` to `each`, in the order of firing. A beam whose last return is
    /// the strongest has one return.
    ///
    /// # Errors
    /// If it is not a data packet of this sensor; `each` is not called then.
    pub fn decode(
        &self,
        payload: &[u8],
        mut each: impl FnMut(&Return),
    ) -> Result<Header, PacketError> {
        let blocks = blocks(payload)?;
        let header = Header::of_blocks(payload, &blocks)?;
        if header.model != self.model {
            return Err(PacketError::OtherModel { expected: self.model, found: header.model });
        }
        let step = header.returns.blocks_per_sequence();
        for (number, blocks) in blocks.chunks_exact(step).enumerate() {
            let block_us = header.firing_us(number);
            let encoder = f64::from(azimuth(blocks[0]));
            for i in 0..self.model.sequences_per_block() * self.lasers.len() {
                let (sequence, laser) =
                    (i / self.lasers.len(), &self.lasers[i % self.lasers.len()]);
                let since_us = sequence as f64 * SEQUENCE_US + laser.fires_us;
                let encoder = encoder + header.units_per_us * since_us;
                let angle = (encoder * AZIMUTH_UNIT_DEG).to_radians() - laser.azimuth_offset;
                let [last, strongest] = [blocks[0], blocks[step - 1]].map(|b| measurement(b, i));
                let kinds = match header.returns {
                    Returns::Dual if last != strongest => {
                        [Some((last, Kind::Last)), Some((strongest, Kind::Strongest))]
                    }
                    Returns::Dual => [Some((last, Kind::Both)), None],
                    Returns::Last => [Some((last, Kind::Last)), None],
                    Returns::Strongest => [Some((last, Kind::Strongest)), None],
                };
                for ((distance, reflectivity), kind) in kinds.into_iter().flatten() {
                    if distance != 0 {
                        let range = f64::from(distance) * self.model.distance_unit_m();
                        let after_us = block_us + since_us;
                        each(&laser.hit(angle, range, reflectivity, after_us, kind));
                    }
                }
            }
        }
        Ok(header)
    }
}

impl Laser {
    fn hit(&self, angle: f64, range: f64, reflectivity: u8, after_us: f64, kind: Kind) -> Return {
        let (sin, cos) = libm::sincos(angle);
        let flat = range * self.cos_elevation;
        // Azimuths grow clockwise.
        let point = [flat * cos, -flat * sin, range * self.sin_elevation - self.drop_m];
        Return {
            point_m: point.map(|x| x as f32),
            range_m: range as f32,
            ring: self.ring,
            reflectivity,
            after_us,
            kind,
        }
    }
}

/// The blocks of a packet, checked.
fn blocks(payload: &[u8]) -> Result<[&[u8]; BLOCKS], PacketError> {
    if payload.len() != PAYLOAD_SIZE {
        return Err(PacketError::Length(payload.len()));
    }
    let mut blocks = [&payload[..0]; BLOCKS];
    for (number, (block, bytes)) in
        blocks.iter_mut().zip(payload.chunks_exact(BLOCK_SIZE)).enumerate()
    {
        if !bytes.starts_with(&FLAG) {
            return Err(PacketError::Flag(number));
        }
        let found = azimuth(bytes);
        if found >= TURN {
            return Err(PacketError::Azimuth { block: number, found });
        }
        *block = bytes;
    }
    Ok(blocks)
}

fn azimuth(block: &[u8]) -> u16 {
    u16::from_le_bytes([block[2], block[3]])
}

/// Distance in the sensor's units, and reflectivity, of measurement `i` of a block.
fn measurement(block: &[u8], i: usize) -> (u16, u8) {
    let bytes = &block[BLOCK_HEADER_SIZE + i * MEASUREMENT_SIZE..];
    (u16::from_le_bytes([bytes[0], bytes[1]]), bytes[2])
}

/// Azimuth units from one azimuth to a later one, or 0 if the head seems to turn backwards.
fn advance(from: u16, to: u16) -> u16 {
    let turned = forward(from, to);
    if turned > TURN / 2 { 0 } else { turned }
}

/// Azimuth units clockwise from one azimuth to another.
pub(super) fn forward(from: u16, to: u16) -> u16 {
    if to >= from { to - from } else { TURN - from + to }
}

/// Of firings at these azimuths, the first behind a sector that was not sent, and how far the head
/// turned in all other steps. The steps of a head that starts, stops or shakes are not even, and
/// tell of no sector.
fn find_jump(azimuths: &[u16]) -> Option<(usize, u16)> {
    // More than the steps of any speed, 0.8 degrees, and than how far a head shakes backwards.
    const LEAST: u16 = 300;
    let steps = || azimuths.windows(2).map(|pair| forward(pair[0], pair[1]));
    let (jump, before) = steps().zip(0..).max()?;
    let others = || steps().zip(0..).filter(|(_, number)| *number != before).map(|(step, _)| step);
    let (least, most) = (others().min()?, others().max()?);
    let is_even = least > 0 && most < LEAST / 2 && most <= 2 * least;
    let is_jump = (LEAST..=TURN - LEAST).contains(&jump);
    (is_even && is_jump).then(|| (before + 1, others().sum()))
}

/// Microseconds from one packet to another, by the shorter way around the hour.
pub(super) fn step_us(from: &Header, to: &Header) -> f64 {
    shorter_way(f64::from(to.time_us) - f64::from(from.time_us), HOUR_US as f64)
}
