//! The flaws of packets.

use std::mem::discriminant;

use formats::packets::PacketError;
pub use formats::packets::{Decoder, Facts};
use formats::velodyne;

/// Why a payload is not the sensor's data, its time is implausible, or its objects come late.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// An error of a packet.
    #[error(transparent)]
    Packet(#[from] PacketError),
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
    /// The objects of a turn cannot be found.
    #[error("{0}")]
    Turn(String),
    /// Several turns in a row took too long, although packets arrive in real time.
    #[error(
        "the objects of a turn take {took_s:.3} s, and the sensor turns in {turn_s:.3} s: results come \
         late, and packets may be lost: try --precision i8 or more threads"
    )]
    Late {
        /// How long they took, seconds.
        took_s: f64,
        /// How long a turn takes, seconds.
        turn_s: f64,
    },
}

impl Flaw {
    /// Whether it is data of another sensor.
    pub(super) fn is_of_another_model(&self) -> bool {
        let other = |error: &PacketError| {
            matches!(error, PacketError::Velodyne(velodyne::PacketError::OtherModel { .. }))
        };
        matches!(self, Self::Packet(error) if other(error))
    }

    /// Whether the other flaw is of the same kind.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        use PacketError::{Ouster, Velodyne};
        match (self, other) {
            (Self::Packet(Velodyne(a)), Self::Packet(Velodyne(b))) => {
                discriminant(a) == discriminant(b)
            }
            (Self::Packet(Ouster(a)), Self::Packet(Ouster(b))) => {
                discriminant(a) == discriminant(b)
            }
            (Self::Times { .. }, Self::Times { .. })
            | (Self::Turn(_), Self::Turn(_))
            | (Self::Late { .. }, Self::Late { .. }) => true,
            _ => false,
        }
    }
}
