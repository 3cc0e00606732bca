//! Point clouds and named objects as ROS 2 messages, without ROS.
//!
//! A [`Message`] knows its name, the text of its definition, and its bytes: plain CDR, as ROS 2
//! sends and records it. [`detections`] and [`markers`] make messages of what
//! `infer-cpu live` prints.
//!
//! ```
//! use edgepuck_ros_messages::{Message, TFMessage};
//!
//! // A header of four bytes, and a sequence of none.
//! assert_eq!(TFMessage::default().to_cdr(), [0, 1, 0, 0, 0, 0, 0, 0]);
//! ```

mod definitions;
mod messages;
mod objects;

pub use messages::*;
pub use objects::{MARKER_LIFETIME_S, Object, detections, markers};

use serde::Serialize;

/// What a message begins with: plain CDR of XCDR version 1, little-endian, no options
/// (OMG DDSI-RTPS 2.5, section 10.2).
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// A message that has a channel of its own.
pub trait Message: Serialize + Sized {
    /// Its name in ROS 2, such as `sensor_msgs/msg/PointCloud2`.
    const NAME: &'static str;

    /// Its definition and those of all that it contains, as MCAP's schema encoding `ros2msg`
    /// has them (<https://mcap.dev/spec/registry#ros2msg>).
    #[must_use]
    fn definition() -> String {
        definitions::with_contents(&Self::NAME.replace("/msg/", "/"))
    }

    /// Its bytes.
    #[must_use]
    fn to_cdr(&self) -> Vec<u8> {
        let mut bytes = ENCAPSULATION.to_vec();
        // Alignment counts from the end of the encapsulation, as the serializer's does.
        cdr_encoding::to_writer::<_, byteorder::LittleEndian, _>(&mut bytes, self)
            .expect("invariant: memory takes all bytes, and messages hold what CDR has");
        bytes
    }
}
