//! Samplers: which points of a cloud a network looks at.
//!
//! [`Sampler`] covers those that need coordinates alone. A Critical Points
//! Layer is put together by whoever computes features: the distinct points
//! ([`CanonicalOrder`]) go through a front end; [`CriticalPoints`] ranks what
//! wins its maxima, and [`Resize`] makes M of them.
//!
//! Nothing here allocates once its memory has grown to a cloud's size.

mod canonical;
mod cpl;
mod fps;
mod hash;
mod outliers;
mod random;
mod resize;
mod spec;
#[cfg(test)]
mod testing;
mod voxel;

use formats::rng::StreamKey;

use crate::kernel::Kernels;

pub use canonical::CanonicalOrder;
pub use cpl::CriticalPoints;
pub use fps::FarthestPoints;
pub use outliers::OutlierFilter;
pub use random::RandomSubset;
use spec::MOST_CRITICAL;
pub use spec::{FpsStart, FrontChoice, Resize, SamplerKind, SamplerSpec};
pub use voxel::VoxelGrid;

/// Why points cannot be chosen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SamplerError {
    /// M is 0.
    #[error("expected a sampler that keeps 1 point or more, found 0")]
    NoPointsWanted,
    /// M is so large that its repetitions would fill memory.
    #[error("expected a Critical Points Layer of at most {MOST_CRITICAL} points, found {0}")]
    TooManyCritical(usize),
    /// A voxel has no such edge.
    #[error("expected a voxel size above 0, found {0}")]
    VoxelSize(f64),
    /// A coordinate is NaN or infinite.
    #[error("point {index}: expected finite coordinates, found ({x}, {y}, {z})")]
    NotFinite {
        /// The point's place in the cloud, from 0.
        index: usize,
        /// Its coordinates.
        x: f32,
        /// Its coordinates.
        y: f32,
        /// Its coordinates.
        z: f32,
    },
    /// More points than indices can count.
    #[error("expected at most 4,294,967,295 points, found {0}")]
    TooManyPoints(usize),
    /// Coordinates alone do not tell critical points.
    #[error("the sampler cpl needs a model, whose features it pools")]
    NeedsFeatures,
}

/// Chooses points by their coordinates; keeps its memory from cloud to cloud.
///
/// ```
/// use infer_cpu::kernel;
/// use infer_cpu::sampler::{Sampler, SamplerKind, SamplerSpec};
///
/// let spec = SamplerSpec { kind: SamplerKind::Fps, points: 2, ..SamplerSpec::default() };
/// let mut sampler = Sampler::new(spec)?;
/// let cloud = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [1.0, 0.0, 0.0]];
/// assert_eq!(sampler.select(&cloud, kernel::fastest())?, [2, 0]);
/// # Ok::<(), infer_cpu::sampler::SamplerError>(())
/// ```
pub struct Sampler {
    spec: SamplerSpec,
    selected: Vec<u32>,
    random: RandomSubset,
    fps: FarthestPoints,
    voxel: VoxelGrid,
}

impl Sampler {
    /// A sampler that does what `spec` says.
    ///
    /// # Errors
    /// A specification that cannot be met: [`SamplerSpec::check`].
    pub fn new(spec: SamplerSpec) -> Result<Self, SamplerError> {
        spec.check()?;
        Ok(Self {
            spec,
            selected: Vec::new(),
            random: RandomSubset::default(),
            fps: FarthestPoints::default(),
            voxel: VoxelGrid::default(),
        })
    }

    /// What it does.
    #[must_use]
    pub fn spec(&self) -> &SamplerSpec {
        &self.spec
    }

    /// Draws by another seed from now on.
    pub fn set_seed(&mut self, seed: u64) {
        self.spec.seed = seed;
    }

    /// The indices of the chosen points, each once, at most as many as there
    /// are. Of no point none are chosen.
    ///
    /// `all` and `first` keep the order of the cloud, `random` and `fps` give
    /// the order in which they take points, `voxel` ascends by x, y, z.
    ///
    /// # Errors
    /// [`SamplerError::NeedsFeatures`] for `cpl`; more points than indices can
    /// count; for `fps` and `voxel`, a coordinate that is not finite.
    pub fn select(
        &mut self,
        points: &[[f32; 3]],
        kernels: &'static Kernels,
    ) -> Result<&[u32], SamplerError> {
        let n =
            u32::try_from(points.len()).map_err(|_| SamplerError::TooManyPoints(points.len()))?;
        let Self { spec, selected, random, fps, voxel } = self;
        match spec.kind {
            SamplerKind::All => keep_first(n, selected),
            SamplerKind::First => keep_first(n.min(spec.points.try_into().unwrap_or(n)), selected),
            SamplerKind::Random => {
                let key = StreamKey::new(spec.seed, "random sampler", 0);
                random.draw(points.len(), spec.points, key, selected);
            }
            SamplerKind::Fps => {
                check_finite(points)?;
                fps.select(points, spec.points, spec.fps_start, kernels, selected);
            }
            SamplerKind::Voxel => {
                check_finite(points)?;
                match spec.voxel_size {
                    Some(size) => voxel.select_by_size(points, size, selected),
                    None => voxel.select_by_count(points, spec.points, selected),
                }
            }
            SamplerKind::Cpl => return Err(SamplerError::NeedsFeatures),
        }
        Ok(selected)
    }
}

fn keep_first(n: u32, selected: &mut Vec<u32>) {
    selected.clear();
    selected.extend(0..n);
}

fn check_finite(points: &[[f32; 3]]) -> Result<(), SamplerError> {
    let is_finite = |point: &[f32; 3]| point.iter().all(|x| x.is_finite());
    match points.iter().position(|point| !is_finite(point)) {
        Some(index) => {
            let [x, y, z] = points[index];
            Err(SamplerError::NotFinite { index, x, y, z })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::testing::{extremes, uniform};
    use super::*;
    use crate::kernel::KernelName;

    fn select(spec: &SamplerSpec, points: &[[f32; 3]]) -> Result<Vec<u32>, SamplerError> {
        let kernels = KernelName::Scalar.kernels().unwrap();
        Sampler::new(spec.clone())?.select(points, kernels).map(<[u32]>::to_vec)
    }

    fn spec(kind: SamplerKind, points: usize) -> SamplerSpec {
        SamplerSpec { kind, points, ..SamplerSpec::default() }
    }

    /// The samplers that need no features.
    fn kinds() -> impl Iterator<Item = SamplerKind> {
        SamplerKind::ALL.into_iter().filter(|&kind| kind != SamplerKind::Cpl)
    }

    #[test]
    fn chosen_indices_are_distinct_and_as_many_as_asked_for() {
        let cloud = uniform(100, 1);
        for kind in kinds() {
            for m in [1, 2, 50, 99, 100, 101, usize::MAX] {
                let mut chosen = select(&spec(kind, m), &cloud).unwrap();
                let n = match kind {
                    SamplerKind::All => 100,
                    // A grid may have fewer cells.
                    SamplerKind::Voxel if m < 100 => chosen.len().min(m),
                    _ => m.min(100),
                };
                assert_eq!(chosen.len(), n, "{kind} to {m}");
                chosen.sort_unstable();
                chosen.dedup();
                assert_eq!(chosen.len(), n, "{kind} to {m}");
                assert!(chosen.iter().all(|&index| index < 100), "{kind} to {m}");
            }
        }
    }

    #[test]
    fn extremes_have_points_too() {
        for (what, cloud, n_distinct) in extremes() {
            for kind in kinds() {
                let chosen = select(&spec(kind, 1000), &cloud).unwrap();
                let expected = match kind {
                    SamplerKind::Fps | SamplerKind::Voxel => n_distinct,
                    _ => cloud.len(),
                };
                assert_eq!(chosen.len(), expected, "{kind}: {what}");
            }
        }
    }

    #[test]
    fn a_seed_decides_what_is_drawn() {
        let cloud = uniform(100, 1);
        let drawn = |seed| {
            let spec = SamplerSpec { seed, ..spec(SamplerKind::Random, 10) };
            select(&spec, &cloud).unwrap()
        };
        assert_eq!(drawn(1), drawn(1));
        assert_ne!(drawn(1), drawn(2));
    }

    #[test]
    fn a_voxel_size_goes_before_a_number_of_points() {
        let cloud = [[0.1; 3], [0.2; 3], [0.7; 3]];
        let spec = SamplerSpec { voxel_size: Some(0.5), ..spec(SamplerKind::Voxel, 1) };
        assert_eq!(select(&spec, &cloud).unwrap(), [0, 2]);
    }

    #[test]
    fn what_cannot_be_sampled_is_an_error() {
        let cloud = [[0.0; 3], [1.0, f32::NAN, 2.0]];
        for kind in [SamplerKind::Fps, SamplerKind::Voxel] {
            let error = select(&spec(kind, 1), &cloud).unwrap_err();
            assert_eq!(
                error.to_string(),
                "point 1: expected finite coordinates, found (1, NaN, 2)"
            );
        }
        let error = select(&spec(SamplerKind::Cpl, 1), &cloud).unwrap_err();
        assert_eq!(error, SamplerError::NeedsFeatures);
        let error = select(&spec(SamplerKind::First, 0), &cloud).unwrap_err();
        assert_eq!(error, SamplerError::NoPointsWanted);
    }

    #[test]
    fn a_sampler_forgets_the_cloud_before() {
        let kernels = KernelName::Scalar.kernels().unwrap();
        for kind in kinds() {
            let spec = spec(kind, 20);
            let mut sampler = Sampler::new(spec.clone()).unwrap();
            for n in [100, 3, 0, 50] {
                let cloud = uniform(n, 2);
                let expected = select(&spec, &cloud).unwrap();
                assert_eq!(sampler.select(&cloud, kernels).unwrap(), expected, "{kind} of {n}");
            }
        }
    }
}
