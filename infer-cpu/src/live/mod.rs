//! Classified and tracked objects from the packets of a LiDAR, while the sensor turns.
//!
//! A [`Pipeline`] takes packets one by one. It decodes each, passes the returns to
//! [`edgepuck_segment::Stream`], classifies complete clusters at all widths, and assigns those that
//! are recognised best to tracks. An [`Object`] is the result for a cluster.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use infer_cpu::live::{Arrival, LiveOptions, Pipeline};
//! use infer_cpu::{Classifier, Options};
//!
//! let classifier = Classifier::load(Path::new("street-128.safetensors"), &Options::default())?;
//! let mut pipeline = Pipeline::new(classifier, &LiveOptions::default())?;
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
mod counts;
mod footprint;
mod kalman;
mod object;
mod object_classifier;
mod options;
mod packet_clock;
mod pipeline;
#[cfg(feature = "mcap")]
mod recorder;
mod report;
mod sensor;
mod sensor_stream;
mod stats;
mod timeline;
mod tracker;
mod waiting;
mod whole;

pub use arrival::Arrival;
pub use counts::Counts;
pub use formats::geometry::{OrientedBox, Pose, Trajectory};
pub use object::{Object, SCHEMA_VERSION};
pub use options::{LiveError, LiveOptions};
pub use pipeline::{Decoded, Pipeline};
#[cfg(feature = "mcap")]
pub use recorder::{RecordError, Recorder};
pub use sensor::Flaw;
pub use stats::{Stage, Stats};
pub use timeline::Timeline;
