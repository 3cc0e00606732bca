//! Samplers with their front ends in one word, such as `cpl:stn`.

use std::fmt;
use std::str::FromStr;

use crate::Options;
use crate::sampler::{SamplerKind, SamplerSpec};
use formats::FormatError;

#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    name: String,
    spec: SamplerSpec,
}

impl Variant {
    /// Whether the network processes every point of a cloud.
    pub fn takes_all(&self) -> bool {
        self.spec.kind == SamplerKind::All
    }

    /// Sets this sampler in `options`, to keep `points`.
    pub fn set(&self, options: &mut Options, points: usize) {
        options.sampler = Some(SamplerSpec { points, ..self.spec.clone() });
    }
}

impl FromStr for Variant {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, front) = text.split_once(':').unwrap_or((text, "auto"));
        let parsed = || -> Result<SamplerSpec, FormatError> {
            Ok(SamplerSpec { kind: kind.parse()?, front: front.parse()?, ..SamplerSpec::default() })
        };
        let spec = parsed().map_err(|error| error.to_string())?;
        Ok(Self { name: text.to_owned(), spec })
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use crate::sampler::FrontChoice;

    use super::*;

    #[test]
    fn front_ends_follow_the_sampler() {
        let variant: Variant = "cpl:stn".parse().unwrap();
        assert_eq!(variant.spec.kind, SamplerKind::Cpl);
        assert_eq!(variant.spec.front, FrontChoice::Stn);
        let error = "cpl:front".parse::<Variant>().unwrap_err();
        assert!(error.contains("unknown front end `front`"), "{error}");
        assert!("fsp".parse::<Variant>().is_err());
    }
}
