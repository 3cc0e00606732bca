//! Classified and tracked objects from the packets of a LiDAR, while the sensor turns.
//!
//! A [`Pipeline`] takes packets one by one and decodes each. When a turn is complete, a
//! [`Detector`](crate::detect::Detector) finds its objects, and the clusters of what is left; all are assigned to
//! tracks. An [`Object`] is the result for each.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use infer_cpu::Options;
//! use infer_cpu::live::{Arrival, LiveOptions, Pipeline};
//!
//! let model = Path::new("street-bev.safetensors");
//! let mut pipeline = Pipeline::open(model, &Options::default(), &LiveOptions::default())?;
//! let socket = std::net::UdpSocket::bind("0.0.0.0:2368")?;
//! let mut packet = [0; 2048];
//! loop {
//!     let n = socket.recv(&mut packet)?;
//!     pipeline.take(&packet[..n], Arrival::now());
//!     pipeline.answer(|object| println!("{:?} at {:?} m", object.class, object.position_m));
//! }
//! # #[allow(unreachable_code)]
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arrival;
mod classes;
mod counts;
mod footprint;
mod kalman;
mod object;
mod options;
mod packet_clock;
mod pipeline;
#[cfg(feature = "mcap")]
mod recorder;
mod report;
mod sensor;
mod sensor_data;
mod stats;
mod timeline;
mod tracker;
mod turns;
mod whole;

pub use arrival::Arrival;
pub use counts::Counts;
pub use formats::geometry::{OrientedBox, Pose, Trajectory};
pub use object::{Object, SCHEMA_VERSION};
pub use options::LiveOptions;
pub use pipeline::{Decoded, Pipeline};
#[cfg(feature = "mcap")]
pub use recorder::{RecordError, Recorder};
pub use sensor::Flaw;
pub use stats::{Stage, Stats};
pub use timeline::Timeline;
