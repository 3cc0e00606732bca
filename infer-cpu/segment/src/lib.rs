//! Cuts a sweep of a LiDAR into ground and clusters, in milliseconds on one core.
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
//! The points are sorted into a range image by ring and azimuth. In each column, the
//! ground is followed from the lowest ring up; what is found becomes a polar grid of
//! heights, and whatever lies little above that grid is ground. The other points are
//! linked to their neighbours in the image, and points that are linked are a cluster.
//! A [`Segmenter`] does this for whole sweeps, a [`Stream`] for returns as they come.
//! Clouds without the structure of a scan are cut into connected components instead.

mod angle;
mod components;
mod ground;
mod height_grid;
mod image;
mod link;
mod open_sets;
mod oriented_box;
mod plane;
mod segmentation;
mod segmenter;
mod sets;
mod settings;
mod stream;

pub use oriented_box::OrientedBox;
pub use segmentation::{Cluster, Label, Segmentation};
pub use segmenter::{SegmentError, Segmenter, Sweep};
pub use settings::{Settings, SettingsError};
pub use stream::{Dropped, Stream, StreamCluster};
