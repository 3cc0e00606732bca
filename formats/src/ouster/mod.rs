//! Decodes the lidar packets of Ouster's OS0, OS1 and OS2, which a sensor sends to UDP port 7502.
//!
//! The sensor's metadata, a JSON file, state the length and the layout of packets. Ouster's programs
//! write the file beside a capture, and the sensor serves it at `/api/v1/sensor/metadata`. Layouts,
//! little-endian (Ouster's Firmware User Manual, "Lidar Data", and ouster-sdk 1.0.1, `parsing.cpp`):
//!
//! | bytes | contents |
//! | --- | --- |
//! | 32, none if LEGACY | type, 1 for lidar; frame u16 at byte 2, or u32 at byte 4 in headers of type FUSA |
//! | for each column: 12 | time u64 in ns, measurement u16, status u16, whose lowest bit is set if valid |
//! | 16 if LEGACY | time and measurement as above, frame u16, encoder u32 |
//! | for each row | a pixel, see [`Profile`] |
//! | 4 if LEGACY | status u32 |
//! | 32, none if LEGACY | checksum |
//!
//! A column has the measurements of all rows at one angle of the encoder, measurement m of M in a
//! turn. With r the range of a row at azimuth a and altitude p, the beams' origin at (x, 0, z) in the
//! lidar frame while the encoder is at 0, and n its distance from the frame's origin, the point is
//!
//! ```text
//! Rz(-2 pi m / M) ((r - n) (cos(p) cos(a), -cos(p) sin(a), sin(p)) + (x, 0, z))
//! ```
//!
//! in the lidar frame, whose x axis points to the connector. `lidar_to_sensor_transform` transforms it
//! to the sensor's frame, whose x axis points forward (Firmware User Manual, "Coordinate Frames and XYZ
//! Calculation"; the same in ouster-sdk, `xyzlut.cpp`).

mod capture;
mod metadata;
mod packet;

pub use capture::read_frame;
pub use metadata::{Metadata, Profile};
pub use packet::{Decoder, Header, PacketError};
