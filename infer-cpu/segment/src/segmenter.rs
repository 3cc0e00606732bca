//! From a sweep to its segmentation.

use crate::components::Components;
use crate::ground::{GroundFinder, sector};
use crate::image::{Columns, RangeImage};
use crate::link::link_column;
use crate::segmentation::{Label, Segmentation};
use crate::sets::Sets;
use crate::settings::{Settings, SettingsError};

/// The points of one sweep of a sensor, or of several stacked closely.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// Metres, in the sensor's frame: its origin is the sensor, z points up.
    pub points: &'a [[f32; 3]],
    /// The ring of each point, counted from the lowest elevation; any other numbers work as well,
    /// one for each laser, because rows are sorted by their elevation.
    pub rings: Option<&'a [u16]>,
}

/// A sweep that cannot be segmented.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentError {
    /// Not one ring for each point.
    #[error("expected {expected} rings, one for each point, found {found}")]
    RingCount {
        /// The number of points.
        expected: usize,
        /// The number of rings.
        found: usize,
    },
    /// More rings than sensors have.
    #[error("expected at most {most} different rings, found {found}")]
    TooManyRings {
        /// The most that are supported.
        most: usize,
        /// How many the sweep has.
        found: usize,
    },
    /// A ring of which the settings do not tell the elevation.
    #[error("expected rings below {expected}, as many as there are elevations, found {found}")]
    UnknownRing {
        /// The number of elevations.
        expected: usize,
        /// A ring of the sweep.
        found: usize,
    },
    /// More points than their indices can count.
    #[error("expected at most 4,294,967,294 points, found {0}")]
    TooManyPoints(usize),
}

/// Segments one sweep after the other. Its memory grows with the largest sweep
/// (most points, most rings) and is then used again.
pub struct Segmenter {
    settings: Settings,
    image: RangeImage,
    finder: GroundFinder,
    components: Components,
    sets: Sets,
    segmentation: Segmentation,
}

impl Segmenter {
    /// A segmenter with these settings.
    ///
    /// # Errors
    /// A setting that is not as it must be.
    pub fn new(settings: Settings) -> Result<Self, SettingsError> {
        settings.check()?;
        Ok(Self {
            settings,
            image: RangeImage::default(),
            finder: GroundFinder::default(),
            components: Components::default(),
            sets: Sets::default(),
            segmentation: Segmentation::default(),
        })
    }

    /// Cuts `sweep` into ground and clusters. The same sweep gives the same result.
    ///
    /// # Errors
    /// Rings that do not fit the points; more than four billion points.
    pub fn segment(&mut self, sweep: &Sweep<'_>) -> Result<&Segmentation, SegmentError> {
        let n = sweep.points.len();
        if n >= u32::MAX as usize {
            return Err(SegmentError::TooManyPoints(n));
        }
        if let Some(found) = sweep.rings.map(<[u16]>::len).filter(|&found| found != n) {
            return Err(SegmentError::RingCount { expected: n, found });
        }
        self.sets.reset(n);
        self.segmentation.labels.clear();
        self.segmentation.labels.resize(n, Label::Invalid);
        match self.settings.radius_m {
            None => self.link_image(sweep)?,
            Some(radius_m) => {
                self.segmentation.ground.reset();
                let labels = &mut self.segmentation.labels;
                self.components.join(sweep.points, radius_m, labels, &mut self.sets);
            }
        }
        self.segmentation.collect(sweep.points, &mut self.sets, &self.settings);
        Ok(&self.segmentation)
    }

    fn link_image(&mut self, sweep: &Sweep<'_>) -> Result<(), SegmentError> {
        let Segmentation { labels, ground, .. } = &mut self.segmentation;
        self.image.fill(sweep, &self.settings, labels)?;
        self.finder.find(&self.image, &self.settings, ground);
        let n_columns = self.image.n_columns();
        self.image.retain(|column, this| {
            let sector = sector(n_columns, column);
            this.height_m = ground.above_ground_m(sector, this.range_m, this.position);
            let is_ground = this.height_m <= self.settings.ground_clearance_m;
            if is_ground {
                labels[this.point as usize] = Label::Ground;
            }
            !is_ground
        });
        for column in 0..n_columns {
            link_column(&self.image, column, &self.settings, &mut self.sets);
        }
        Ok(())
    }
}
