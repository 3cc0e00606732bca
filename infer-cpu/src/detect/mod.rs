//! The objects of a sweep: what a network sees from above, and what another one says of its points.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use infer_cpu::Options;
//! use infer_cpu::detect::{Detector, Sweep};
//!
//! let model = Path::new("street-bev.safetensors");
//! let mut detector = Detector::open(model, &Options::default(), 20)?;
//! // In metres in the sensor's frame, z up.
//! let points = [[5.0, 1.0, -1.2], [5.0, 1.1, -1.1]];
//! let found = detector.detect(&Sweep { points: &points, rings: None })?;
//! for object in &found.objects {
//!     println!("{} at {:?} m", object.class, object.whole.centre_m);
//! }
//! # Ok::<(), infer_cpu::detect::DetectError>(())
//! ```

mod candidates;
mod confidence;
mod detector;
mod object;

pub use detector::{DetectError, Detections, Detector, LEAST_CONFIDENCE};
pub use edgepuck_segment::{Cluster, Label, OrientedBox, Settings, Sweep};
pub use object::Object;
