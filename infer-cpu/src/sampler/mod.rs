//! Samplers, which choose the points of a cloud that a network processes.
//!
//! A [`SamplerSpec`] describes a sampler. [`choose`](crate::choose) runs those that need only
//! coordinates. A Critical Points Layer runs inside a [`Classifier`](crate::Classifier): a front end
//! computes features of the distinct points, and `CriticalPoints` ranks the points that win its
//! maxima, of which the M best are kept.
//!
//! Samplers allocate memory only for a cloud that is larger than all before.

mod canonical;
mod cpl;
mod fps;
mod hash;
mod random;
mod spec;
#[cfg(test)]
mod testing;

use edgepuck_kernels::Kernels;
use formats::streams::Stream;

pub(crate) use canonical::CanonicalOrder;
#[doc(hidden)]
pub use cpl::CriticalPoints;
#[doc(hidden)]
pub use fps::FarthestPoints;
#[doc(hidden)]
pub use random::RandomSubset;
pub use spec::{FpsStart, FrontChoice, SamplerKind, SamplerSpec};

/// Errors of sampling.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SamplerError {
    /// The number of points to keep is 0.
    #[error("expected a sampler that keeps 1 point or more, found 0")]
    NoPointsWanted,
    /// More points than a 32-bit index can count.
    #[error("expected at most 4,294,967,295 points, found {0}")]
    TooManyPoints(usize),
    /// Critical points cannot be determined from coordinates alone.
    #[error("the sampler cpl needs a model, whose features it pools")]
    NeedsFeatures,
}

/// Chooses points by their coordinates, which must be finite, and reuses its memory for each cloud.
#[doc(hidden)]
pub struct Sampler {
    spec: SamplerSpec,
    selected: Vec<u32>,
    random: RandomSubset,
    fps: FarthestPoints,
}

impl Sampler {
    /// A sampler with the specification `spec`.
    ///
    /// # Errors
    /// An invalid specification: see [`SamplerSpec::check`].
    pub fn new(spec: SamplerSpec) -> Result<Self, SamplerError> {
        spec.check()?;
        Ok(Self {
            spec,
            selected: Vec::new(),
            random: RandomSubset::default(),
            fps: FarthestPoints::default(),
        })
    }

    /// The specification.
    #[must_use]
    pub fn spec(&self) -> &SamplerSpec {
        &self.spec
    }

    /// The indices of the chosen points, each once. An empty cloud gives none.
    ///
    /// `all` and `first` keep the order of the cloud, `random` and `fps` return points in the order
    /// of choice.
    ///
    /// # Errors
    /// [`SamplerError::NeedsFeatures`] for `cpl`; more points than a 32-bit index can count; for
    /// `fps`, a coordinate that is not finite.
    pub fn select(
        &mut self,
        points: &[[f32; 3]],
        kernels: &'static Kernels,
    ) -> Result<&[u32], SamplerError> {
        let n =
            u32::try_from(points.len()).map_err(|_| SamplerError::TooManyPoints(points.len()))?;
        let Self { spec, selected, random, fps } = self;
        match spec.kind {
            SamplerKind::All => keep_first(n, selected),
            SamplerKind::First => keep_first(n.min(spec.points.try_into().unwrap_or(n)), selected),
            SamplerKind::Random => {
                // The key does not depend on the cloud, so that equal clouds give equal subsets.
                let key = Stream::RandomSampler {}.key(spec.seed);
                random.draw(points.len(), spec.points, key, selected);
            }
            SamplerKind::Fps => {
                fps.select(points, spec.points, spec.fps_start, kernels, selected);
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

#[cfg(test)]
mod tests {
    use super::testing::{extremes, uniform};
    use super::*;
    use edgepuck_kernels::KernelName;

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
                    SamplerKind::Fps => n_distinct,
                    _ => cloud.len(),
                };
                assert_eq!(chosen.len(), expected, "{kind}: {what}");
            }
        }
    }

    #[test]
    fn random_points_depend_on_the_seed() {
        let cloud = uniform(100, 1);
        let drawn = |seed| {
            let spec = SamplerSpec { seed, ..spec(SamplerKind::Random, 10) };
            select(&spec, &cloud).unwrap()
        };
        assert_eq!(drawn(1), drawn(1));
        assert_ne!(drawn(1), drawn(2));
    }

    #[test]
    fn invalid_specifications_fail() {
        let cloud = [[0.0; 3]];
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
