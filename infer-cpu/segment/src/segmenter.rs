use crate::components::Components;
use crate::ground::{GroundFinder, sector};
use crate::hierarchy::{Hierarchy, Node};
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
    hierarchy: Hierarchy,
    /// The nodes of the last cut.
    kept: Vec<usize>,
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
            hierarchy: Hierarchy::default(),
            kept: Vec::new(),
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

    /// Finds the ground of `sweep`, and the clusters of its other points at several widths. Each has
    /// [`Settings::min_points`] or more; there is no largest size, and no
    /// [`Settings::radius_m`]. The same sweep gives the same result.
    ///
    /// # Errors
    /// As [`Segmenter::segment`].
    pub fn hierarchy(&mut self, sweep: &Sweep<'_>) -> Result<&Hierarchy, SegmentError> {
        self.begin(sweep)?;
        self.remove_ground(sweep)?;
        let Self { settings, image, hierarchy, segmentation, .. } = self;
        hierarchy.build(image, sweep.points, settings, &segmentation.ground);
        Ok(&self.hierarchy)
    }

    /// The best cut of the hierarchy of the last sweep, by the worth of each of its nodes: a node is
    /// kept if its worth is at least `1 + margin` times that of the best cut of those of which it is
    /// made. Returns the number of the node of each cluster, too.
    ///
    /// # Panics
    /// If there is not one worth for each node.
    pub fn cut(&mut self, worths: &[f64], margin: f64) -> (&[usize], &Segmentation) {
        let Self { hierarchy, segmentation, kept, .. } = self;
        assert_eq!(worths.len(), hierarchy.len(), "worths");
        segmentation.begin_cut();
        kept.clear();
        kept.extend_from_slice(hierarchy.cut(worths, margin));
        kept.sort_unstable_by_key(|&node| hierarchy.node(node).points.iter().min().copied());
        for &node in &*kept {
            let Node { points, ground_z_m, .. } = hierarchy.node(node);
            segmentation.push(points, ground_z_m);
        }
        (kept, segmentation)
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
        self.hierarchy.clear();
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
