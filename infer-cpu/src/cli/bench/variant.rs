//! Samplers with options in one word, such as `cpl:stn` or `random:votes5`.

use std::fmt;
use std::str::FromStr;

use crate::Options;
use crate::sampler::{SamplerKind, SamplerSpec};
use formats::FormatError;

#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    name: String,
    spec: SamplerSpec,
    votes: u32,
    rotations: bool,
}

impl Variant {
    /// Whether the network processes every point of a cloud.
    pub fn takes_all(&self) -> bool {
        self.spec.kind == SamplerKind::All
    }

    /// Sets this sampler in `options`, to keep `points`.
    pub fn set(&self, options: &mut Options, points: usize) {
        options.sampler = Some(SamplerSpec { points, ..self.spec.clone() });
        options.votes = self.votes;
        options.vote_rotations = self.rotations;
    }
}

impl FromStr for Variant {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut words = text.split(':');
        let kind = words.next().unwrap_or_default();
        let kind = kind.parse().map_err(|error: FormatError| error.to_string())?;
        let spec = SamplerSpec { kind, ..SamplerSpec::default() };
        let mut variant = Self { name: text.to_owned(), spec, votes: 1, rotations: false };
        for word in words {
            if let Ok(front) = word.parse() {
                variant.spec.front = front;
            } else if let Some(Ok(votes)) = word.strip_prefix("votes").map(str::parse) {
                variant.votes = votes;
            } else if word == "turned" {
                variant.rotations = true;
            } else {
                return Err(format!(
                    "unknown word `{word}` after the sampler, expected a front end, votesN or turned"
                ));
            }
        }
        Ok(variant)
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
    fn a_variant_says_what_follows_the_sampler() {
        let variant: Variant = "cpl:stn".parse().unwrap();
        assert_eq!(variant.spec.kind, SamplerKind::Cpl);
        assert_eq!(variant.spec.front, FrontChoice::Stn);
        let variant: Variant = "random:votes5:turned".parse().unwrap();
        assert_eq!((variant.votes, variant.rotations), (5, true));
        assert!("fps:votes".parse::<Variant>().unwrap_err().contains("unknown word `votes`"));
        assert!("fsp".parse::<Variant>().is_err());
    }
}
