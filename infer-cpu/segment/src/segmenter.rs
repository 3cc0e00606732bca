use crate::components::Components;
use crate::ground::{GroundFinder, sector};
use crate::image::{Columns, RangeImage};
use crate::label::Label;
use crate::link::link_column;
use crate::segmentation::Segmentation;
use crate::sets::Sets;
use crate::settings::{Settings, SettingsError};
use crate::sweep::{SegmentError, Sweep};

/// Segments one sweep after the other. Its memory grows to the largest sweep (most points, most
/// rings) and is reused.
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
    /// An invalid setting.
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

    /// Segments `sweep` into ground and clusters. The same sweep gives the same result.
    ///
    /// # Errors
    /// A wrong number of rings, or more than four billion points.
    pub fn segment(&mut self, sweep: &Sweep<'_>) -> Result<&Segmentation, SegmentError> {
        self.begin(sweep)?;
        self.sets.reset(sweep.points.len());
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

    /// Makes each of `objects`, its points and the height of the ground under it, a cluster of the last sweep: the
    /// first ones. Another cluster stays one if it keeps half of its points and [`Settings::min_points`] or more.
    ///
    /// # Panics
    /// If a point is not one of the sweep.
    pub fn claim<'a>(&mut self, objects: impl Iterator<Item = (&'a [u32], Option<f32>)>) {
        self.segmentation.claim(objects, self.settings.min_points);
    }

    /// The last sweep, segmented.
    #[must_use]
    pub fn segmentation(&self) -> &Segmentation {
        &self.segmentation
    }

    fn begin(&mut self, sweep: &Sweep<'_>) -> Result<(), SegmentError> {
        let n = sweep.points.len();
        if n >= u32::MAX as usize {
            return Err(SegmentError::TooManyPoints(n));
        }
        if let Some(found) = sweep.rings.map(<[u16]>::len).filter(|&found| found != n) {
            return Err(SegmentError::RingCount { expected: n, found });
        }
        self.segmentation.labels.clear();
        self.segmentation.labels.resize(n, Label::Invalid);
        Ok(())
    }

    fn link_image(&mut self, sweep: &Sweep<'_>) -> Result<(), SegmentError> {
        self.remove_ground(sweep)?;
        for column in 0..self.image.n_columns() {
            link_column(&self.image, column, &self.settings, &mut self.sets);
        }
        Ok(())
    }

    /// Fills the image with all returns but those of the ground.
    fn remove_ground(&mut self, sweep: &Sweep<'_>) -> Result<(), SegmentError> {
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
        Ok(())
    }
}
