//! Sampling by coordinates, without a network.

use crate::classify::normalize::to_unit_sphere;
use crate::error::Error;
use crate::kernel;
use crate::sampler::{Sampler, SamplerSpec};

/// The indices of the points of `points` `[n, 3]`, in any unit, that `spec` chooses.
///
/// Samplers compute in f32, which loses precision far from the origin: the cloud is first moved and
/// scaled to the unit sphere. A Critical Points Layer needs a model: [`crate::Classifier::sample`].
///
/// ```
/// use infer_cpu::sampler::{SamplerKind, SamplerSpec};
///
/// let cloud = [[5e6, 0.0, 0.0], [5e6 + 0.1, 0.0, 0.0], [5e6 + 1.0, 0.0, 0.0]];
/// let spec = SamplerSpec { kind: SamplerKind::Fps, points: 2, ..SamplerSpec::default() };
/// assert_eq!(infer_cpu::choose(&cloud, &spec)?, [2, 0]);
/// # Ok::<(), infer_cpu::Error>(())
/// ```
///
/// # Errors
/// An invalid specification; a cloud without points, or with a coordinate that is not finite; the
/// sampler `cpl`.
pub fn choose(points: &[[f64; 3]], spec: &SamplerSpec) -> Result<Vec<u32>, Error> {
    spec.check()?;
    if points.is_empty() {
        return Err(Error::NoPoints);
    }
    check_finite(points)?;
    let mut normalized = Vec::new();
    to_unit_sphere(points, &mut normalized);
    Ok(Sampler::new(spec.clone())?.select(&normalized, kernel::fastest())?.to_vec())
}

pub fn check_finite(points: &[[f64; 3]]) -> Result<(), Error> {
    match points.iter().position(|point| !point.iter().all(|x| x.is_finite())) {
        Some(index) => Err(Error::NotFinite { index, point: points[index] }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::SamplerKind;

    fn spec(kind: SamplerKind, points: usize) -> SamplerSpec {
        SamplerSpec { kind, points, ..SamplerSpec::default() }
    }

    #[test]
    fn choosing_from_empty_or_invalid_clouds_fails() {
        let fps = spec(SamplerKind::Fps, 2);
        assert!(matches!(choose(&[], &fps), Err(Error::NoPoints)));
        let cloud = [[0.0; 3], [0.0, f64::NAN, 1.0]];
        assert!(matches!(choose(&cloud, &fps), Err(Error::NotFinite { index: 1, .. })));
        assert!(matches!(choose(&[[0.0; 3]], &spec(SamplerKind::Cpl, 2)), Err(Error::Sampler(_))));
    }

    #[test]
    fn no_magnitude_is_too_large_or_too_small() {
        for scale in [1e-300, 1e-30, 1e30, 1e300] {
            let cloud: Vec<[f64; 3]> = (0..9).map(|i| [f64::from(i) * scale, 0.0, 0.0]).collect();
            let ends = choose(&cloud, &spec(SamplerKind::Fps, 2)).unwrap();
            assert_eq!(ends, [0, 8], "{scale:e}");
        }
    }
}
