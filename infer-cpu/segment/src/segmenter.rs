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
