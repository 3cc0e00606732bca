use crate::on_demand::Clouds;
use formats::Split;
use formats::streams::Stream;

/// The order in which clouds are put into tars: one view of each mesh, in random order, then the
/// next view of each. A tar therefore has all classes if it has as many clouds as there are meshes.
pub(super) struct Order {
    meshes: Vec<usize>,
    views: usize,
}

impl Order {
    pub(super) fn new(seed: u64, split: Split, clouds: &Clouds) -> Self {
        let views = clouds.config().sets[0].viewpoints.count().max(1);
        let key = Stream::Tars { split: split.name() }.key(seed);
        let mut meshes: Vec<usize> = (0..clouds.len() / views).collect();
        meshes.sort_by_cached_key(|&mesh| (key.words([mesh as u32, 0, 0, 0]), mesh));
        Self { meshes, views }
    }

    pub(super) fn len(&self) -> usize {
        self.meshes.len() * self.views
    }

    /// The index among [`Clouds`] of the cloud at this place.
    pub(super) fn at(&self, place: usize) -> usize {
        let (view, rank) = (place / self.meshes.len(), place % self.meshes.len());
        self.meshes[rank] * self.views + view
    }
}
