use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;

use super::SamplerError;

formats::named! {
    /// A sampling method.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum SamplerKind: "sampler" {
        /// Every point.
        #[default]
        All = "all",
        /// The first M points.
        First = "first",
        /// M random points.
        Random = "random",
        /// M points by farthest point sampling.
        Fps = "fps",
        /// A Critical Points Layer: the M points that win most of a max-pooling, or fewer.
        Cpl = "cpl",
    }
}

formats::named! {
    /// The first point of farthest point sampling.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum FpsStart: "start of farthest point sampling" {
        /// The point farthest from the mean of all points, so that the result does not depend on
        /// the order of the points.
        #[default]
        Farthest = "farthest",
        /// The first point of the cloud, as in reference implementations.
        First = "first",
    }
}

formats::named! {
    /// The network whose features a Critical Points Layer pools.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum FrontChoice: "front end" {
        /// The model's own front end if it has one, else the trunk of its input transform, else its
        /// trunk.
        #[default]
        Auto = "auto",
        /// The front end of the model file.
        Own = "own",
        /// The trunk of the input transform (STN3d), whose features the classifier computes anyway.
        Stn = "stn",
        /// The trunk of the network.
        Trunk = "trunk",
    }
}

/// The specification of a sampler.
#[derive(Clone, Debug, PartialEq)]
pub struct SamplerSpec {
    /// The method.
    pub kind: SamplerKind,
    /// The number of points to keep, M; ignored by `all`.
    pub points: usize,
    /// The seed of random draws.
    pub seed: u64,
    /// The first point of `fps`.
    pub fps_start: FpsStart,
    /// The layers whose features `cpl` pools.
    pub front: FrontChoice,
}

impl Default for SamplerSpec {
    fn default() -> Self {
        Self {
            kind: SamplerKind::default(),
            points: 1024,
            seed: 0,
            fps_start: FpsStart::default(),
            front: FrontChoice::default(),
        }
    }
}

impl SamplerSpec {
    /// The sampler of the training of the model at `path`, according to its `card`.
    ///
    /// # Errors
    /// A card with an unknown sampler.
    pub fn as_trained(path: &Path, card: &ModelCard) -> Result<Self, FormatError> {
        let bad = |key: &str| {
            let part = format!("metadata `{key}`");
            move |cause: FormatError| FormatError::malformed(path, part, cause)
        };
        let mut spec = Self::default();
        if let Some(kind) = &card.sampler {
            spec.kind = kind.parse().map_err(bad("sampler"))?;
        }
        if let Some(start) = &card.fps_start {
            spec.fps_start = start.parse().map_err(bad("fps_start"))?;
        }
        spec.points = card.points.unwrap_or(spec.points);
        Ok(spec)
    }

    /// Checks the specification.
    ///
    /// # Errors
    /// M is 0 but needed.
    pub fn check(&self) -> Result<(), SamplerError> {
        match self.kind {
            SamplerKind::All => Ok(()),
            _ if self.points == 0 => Err(SamplerError::NoPointsWanted),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_parsed_and_others_refused() {
        let words = ["all", "first", "random", "fps", "cpl"];
        let kinds: Vec<SamplerKind> = words.iter().map(|word| word.parse().unwrap()).collect();
        assert_eq!(kinds, SamplerKind::ALL);
        assert_eq!(kinds.iter().map(ToString::to_string).collect::<Vec<_>>(), words);
        assert_eq!(
            "fsp".parse::<SamplerKind>().unwrap_err().to_string(),
            "unknown sampler `fsp`, expected one of all, first, random, fps, cpl"
        );
    }

    #[test]
    fn invalid_specifications_fail() {
        for kind in SamplerKind::ALL {
            let spec = SamplerSpec { kind, points: 0, ..SamplerSpec::default() };
            assert_eq!(spec.check().is_ok(), kind == SamplerKind::All, "{kind}");
            assert_eq!(SamplerSpec { points: 1, ..spec }.check(), Ok(()));
        }
    }
}
