//! Lidar packets of Ouster's OS0, OS1 and OS2, read: what a sensor sends to UDP port 7502.
//!
//! How long packets are and what their bits mean is told by the sensor's metadata, a JSON file
//! that Ouster's programs write beside a capture and that a sensor itself gives at
//! `/api/v1/sensor/metadata`. Layouts: Ouster's Firmware User Manual, "Lidar Data", and
//! ouster-sdk 1.0.1, `parsing.cpp`; little-endian:
//!
//! | bytes | what |
//! | --- | --- |
//! | 32, none if LEGACY | type, 1 for lidar; frame u16 at byte 2, or u32 at byte 4 in headers of type FUSA |
//! | for each column: 12 | time u64 in ns, measurement u16, status u16 whose lowest bit says valid |
//! | 16 if LEGACY | the same but for the status: frame u16, encoder u32 |
//! | for each row | a pixel, see [`Profile`] |
//! | 4 if LEGACY | status u32 |
//! | 32, none if LEGACY | checksum |
//!
//! A column is what all rows measure at one angle of the encoder, measurement m of M in a turn.
//! With r the range of a row at azimuth a and altitude p, and the beams' origin at (x, 0, z) in the
//! lidar frame as the encoder is at 0 (n: how far that is from the axis' origin), it saw the point
//!
//! ```text
//! Rz(-2 pi m / M) ((r - n) (cos(p) cos(a), -cos(p) sin(a), sin(p)) + (x, 0, z))
//! ```
//!
//! of the lidar frame, in which x points to the connector; `lidar_to_sensor_transform` takes it to
//! the sensor's frame, in which x points forward (Firmware User Manual, "Coordinate Frames and XYZ
//! Calculation"; the same in ouster-sdk, `xyzlut.cpp`).

mod capture;
mod metadata;
mod packet;

pub use capture::read_frame;
pub use metadata::{Metadata, Profile};
pub use packet::{Decoder, Header, PacketError};
