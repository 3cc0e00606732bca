//! The sensors whose packets are decoded.

use crate::vlp32c::{BEAM_CROSSING_M, DISTANCE_UNIT_M, SEQUENCE_US};

crate::named! {
    /// A spinning sensor of Velodyne.
    pub enum Model: "sensor model" {
        /// VLP-16 "Puck".
        Vlp16 = "vlp16",
        /// VLP-32C "UltraPuck".
        Vlp32c = "vlp32c",
    }
}

/// Elevations of a VLP-16's lasers, degrees: ros-drivers/velodyne, `VLP16db.yaml`.
const VLP16_DEG: [f64; 16] =
    [-15.0, 1.0, -13.0, 3.0, -11.0, 5.0, -9.0, 7.0, -7.0, 9.0, -5.0, 11.0, -3.0, 13.0, -1.0, 15.0];

/// Azimuth offsets and elevations of a VLP-32C's lasers, degrees: User Manual 63-9325, chapter 9;
/// the same in ros-drivers/velodyne, `VeloView-VLP-32C.yaml`.
const VLP32C_DEG: [[f64; 32]; 2] = [
    [
        -1.4, 4.2, -1.4, 1.4, -1.4, 1.4, -4.2, 1.4, -1.4, 4.2, -1.4, 1.4, -4.2, 1.4, -4.2, 1.4,
        -1.4, 4.2, -1.4, 4.2, -4.2, 1.4, -1.4, 1.4, -1.4, 1.4, -1.4, 4.2, -4.2, 1.4, -1.4, 1.4,
    ],
    [
        -25.0, -1.0, -1.667, -15.639, -11.31, 0.0, -0.667, -8.843, -7.254, 0.333, -0.333, -6.148,
        -5.333, 1.333, 0.667, -4.0, -4.667, 1.667, 1.0, -3.667, -3.333, 3.333, 2.333, -2.667, -3.0,
        7.0, 4.667, -2.333, -2.0, 15.0, 10.333, -1.333,
    ],
];

/// Time between two firings of a sequence, microseconds (both user manuals).
const FIRING_US: f64 = 2.304;

/// Distance from the axis at which the beams of a VLP-16 cross, metres: from the vertical corrections
/// in `VLP16db.yaml`, 11.2 mm at 15 degrees.
const VLP16_CROSSING_M: f64 = 0.0419;

#[derive(Clone, Copy, Debug)]
pub(super) struct Laser {
    /// Its ring, from the lowest elevation.
    pub ring: u16,
    /// Azimuth offset from the encoder, radians.
    pub azimuth_offset: f64,
    pub sin_elevation: f64,
    pub cos_elevation: f64,
    /// Distance of the beam below a beam that crosses the axis at the origin, metres.
    pub drop_m: f64,
    /// Time after the start of the firing sequence, microseconds.
    pub fires_us: f64,
}

impl Model {
    /// The model with this last byte of packets.
    #[must_use]
    pub fn of_byte(byte: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.byte() == byte)
    }

    /// The last byte of its packets (VLP-16 User Manual 63-9243, table 9-5).
    #[must_use]
    pub fn byte(self) -> u8 {
        match self {
            Self::Vlp16 => 0x22,
            Self::Vlp32c => crate::vlp32c::packet::MODEL,
        }
    }

    /// The unit of distances in its packets, metres.
    pub(super) fn distance_unit_m(self) -> f64 {
        match self {
            Self::Vlp16 => 0.002,
            Self::Vlp32c => DISTANCE_UNIT_M,
        }
    }

    /// Firing sequences in a block.
    pub(super) fn sequences_per_block(self) -> usize {
        match self {
            Self::Vlp16 => 2,
            Self::Vlp32c => 1,
        }
    }

    /// Duration of a block, microseconds.
    pub(super) fn block_us(self) -> f64 {
        self.sequences_per_block() as f64 * SEQUENCE_US
    }

    /// Its lasers, in the order of packets.
    pub(super) fn lasers(self) -> Vec<Laser> {
        let [offsets_deg, elevations_deg]: [&[f64]; 2] = match self {
            Self::Vlp16 => [&[0.0; 16], &VLP16_DEG],
            Self::Vlp32c => [&VLP32C_DEG[0], &VLP32C_DEG[1]],
        };
        let (crossing_m, at_once) = match self {
            Self::Vlp16 => (VLP16_CROSSING_M, 1),
            Self::Vlp32c => (BEAM_CROSSING_M, 2),
        };
        let laser = |(number, (offset, elevation)): (usize, (&f64, &f64))| Laser {
            ring: elevations_deg.iter().filter(|other| *other < elevation).count() as u16,
            azimuth_offset: offset.to_radians(),
            sin_elevation: libm::sin(elevation.to_radians()),
            cos_elevation: libm::cos(elevation.to_radians()),
            drop_m: crossing_m * libm::tan(elevation.to_radians()),
            fires_us: (number / at_once) as f64 * FIRING_US,
        };
        offsets_deg.iter().zip(elevations_deg).enumerate().map(laser).collect()
    }
}
