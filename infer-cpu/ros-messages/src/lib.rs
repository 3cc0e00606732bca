//! Point clouds and named objects as ROS 2 messages, without ROS.
//!
//! A [`Message`] knows its name, the text of its definition, and its bytes: plain CDR, as ROS 2
//! sends and records it. [`detections`] and [`markers`] turn the output of `infer-cpu live` into
//! messages.
//!
//! ```
//! use edgepuck_ros_messages::{Message, TFMessage};
//!
//! // A header of four bytes, and an empty sequence.
//! assert_eq!(TFMessage::default().to_cdr(), [0, 1, 0, 0, 0, 0, 0, 0]);
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod definitions;
mod messages;
mod objects;

pub use messages::*;
pub use objects::{MARKER_LIFETIME_S, Object, detections, markers};

use serde::Serialize;

/// The encapsulation header of a message: plain CDR of XCDR version 1, little-endian, no options
/// (OMG DDSI-RTPS 2.5, section 10.2).
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// A message that can be published or recorded.
pub trait Message: Serialize + Sized {
    /// Its name in ROS 2, such as `sensor_msgs/msg/PointCloud2`.
    const NAME: &'static str;

    /// Its definition and those of all types that it contains, in MCAP's schema encoding `ros2msg`
    /// (<https://mcap.dev/spec/registry#ros2msg>).
    #[must_use]
    fn definition() -> String {
        definitions::with_contents(&Self::NAME.replace("/msg/", "/"))
    }

    /// The message in CDR, with the encapsulation header.
    #[must_use]
    fn to_cdr(&self) -> Vec<u8> {
        let mut bytes = ENCAPSULATION.to_vec();
        // The serializer aligns relative to its first byte, and CDR relative to the end of the
        // header: both agree.
        cdr_encoding::to_writer::<_, byteorder::LittleEndian, _>(&mut bytes, self)
            .expect("invariant: memory takes all bytes, and messages hold what CDR has");
        bytes
    }
}
