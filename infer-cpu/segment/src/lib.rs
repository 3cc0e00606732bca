//! Segments a LiDAR sweep into ground and clusters, in milliseconds on one core.
//!
//! ```
//! use edgepuck_segment::{Label, Segmenter, Settings, Sweep};
//!
//! let post: Vec<_> = (0..30).map(|i| [5.0, 0.0, 0.05 * i as f32 - 1.0]).collect();
//! let mut segmenter = Segmenter::new(Settings::default())?;
//! let segmentation = segmenter.segment(&Sweep { points: &post, rings: None })?;
//! assert_eq!(segmentation.labels()[20], Label::Cluster(0));
//! for cluster in segmentation.clusters() {
//!     println!("{} points over ground at {:?} m", cluster.points.len(), cluster.ground_z_m);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The points are sorted into a range image by ring and azimuth. In each column, the ground is
//! followed from the lowest ring up. The ground returns give a polar grid of heights; every point
//! just above that grid is ground. The other points are linked to their neighbours in the image,
//! and linked points form a cluster. A [`Segmenter`] does this for one sweep after the
//! other. Clouds without the structure of a scan are cut into connected components instead.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod angle;
mod axes;
mod components;
mod ground;
mod height_grid;
mod image;
mod label;
mod link;
mod plane;
mod segmentation;
mod segmenter;
mod sets;
mod settings;
mod sweep;

pub use axes::other_axis_up;
pub use formats::geometry::OrientedBox;
pub use label::Label;
pub use segmentation::{Cluster, Extent, Segmentation};
pub use segmenter::Segmenter;
pub use settings::{Settings, SettingsError};
pub use sweep::{SegmentError, Sweep};
