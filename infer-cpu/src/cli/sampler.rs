use crate::sampler::{FpsStart, FrontChoice, SamplerKind, SamplerSpec};

use super::Usage;

/// The flags besides the name of the sampler.
#[derive(clap::Args, Default)]
pub struct SamplerArgs {
    /// Number of points to keep [default: as in training, else 1024]
    #[arg(long, value_name = "M")]
    points: Option<usize>,

    /// Seed of random draws [default: 0]
    #[arg(long)]
    seed: Option<u64>,

    /// First point of fps: `farthest` takes the point farthest from the centroid, which does not
    /// depend on the order of the points; `first` takes the first point of the cloud [default: as
    /// in training, else farthest]
    #[arg(long, value_name = "WHERE")]
    fps_start: Option<FpsStart>,

    /// Layers whose features cpl pools: `own` is the model's own front end, `stn` the trunk of its
    /// input T-Net, `trunk` its trunk, and `auto` the first of these that the model has [default:
    /// auto]
    #[arg(long, value_name = "NET")]
    front: Option<FrontChoice>,
}

impl SamplerArgs {
    /// The sampler `kind`, or that of `trained`; these flags override the values of `trained`.
    pub fn apply(
        &self,
        kind: Option<SamplerKind>,
        trained: SamplerSpec,
    ) -> Result<SamplerSpec, Usage> {
        let kind = kind.unwrap_or(trained.kind);
        self.check_flags(kind)?;
        Ok(SamplerSpec {
            kind,
            points: self.points.unwrap_or(trained.points),
            seed: self.seed.unwrap_or(trained.seed),
            fps_start: self.fps_start.unwrap_or(trained.fps_start),
            front: self.front.unwrap_or(trained.front),
        })
    }

    fn check_flags(&self, kind: SamplerKind) -> Result<(), Usage> {
        use SamplerKind::{Cpl, First, Fps, Random};
        let flags: [(_, _, &[SamplerKind]); 3] = [
            ("--points", self.points.is_some(), &[First, Random, Fps, Cpl]),
            ("--fps-start", self.fps_start.is_some(), &[Fps]),
            ("--front", self.front.is_some(), &[Cpl]),
        ];
        match flags.iter().find(|(_, is_given, kinds)| *is_given && !kinds.contains(&kind)) {
            Some((flag, _, kinds)) => {
                let kinds: Vec<_> = kinds.iter().map(|kind| kind.name()).collect();
                Err(Usage(format!(
                    "{flag} does not apply to the sampler {kind}; it applies to {}",
                    kinds.join(", ")
                )))
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_replace_parts_of_the_trained_sampler() {
        let trained = SamplerSpec {
            kind: SamplerKind::Fps,
            points: 64,
            fps_start: FpsStart::First,
            ..SamplerSpec::default()
        };
        assert_eq!(SamplerArgs::default().apply(None, trained.clone()).unwrap(), trained);
        let fewer =
            SamplerArgs { points: Some(32), ..SamplerArgs::default() }.apply(None, trained.clone());
        assert_eq!(fewer.unwrap(), SamplerSpec { points: 32, ..trained.clone() });
        let random =
            SamplerArgs::default().apply(Some(SamplerKind::Random), trained.clone()).unwrap();
        assert_eq!(random, SamplerSpec { kind: SamplerKind::Random, ..trained });
    }
}
