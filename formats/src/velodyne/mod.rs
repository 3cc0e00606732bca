//! Decodes the data packets of spinning Velodyne sensors: a VLP-16 or a VLP-32C sends packets of 1206
//! bytes to UDP port 2368.
//!
//! [`crate::vlp32c`], which writes such packets, has the layout. A VLP-16's blocks hold two
//! firing sequences of 16 lasers, which fire one at a time, and its unit of distance is 2 mm (VLP-16
//! User Manual 63-9243, chapter 9). With both returns, each pair of blocks is of the same sequences,
//! the last return first.

mod capture;
mod model;
mod packet;
mod sector;

pub use capture::{count_returns, read_turn};
pub use model::Model;
pub use packet::{Decoder, Header, PacketError};
pub(crate) use sector::Sector;
pub use sector::UnsentPackets;
