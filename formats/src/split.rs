//! The two halves of a dataset.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::FormatError;

/// Which half of a dataset an instance belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    /// What a network learns from.
    Train,
    /// What it is measured on.
    Test,
}

impl Split {
    /// Both halves.
    pub const ALL: [Self; 2] = [Self::Train, Self::Test];

    /// The half's name in folders and files: `train` or `test`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Test => "test",
        }
    }
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Split {
    type Err = FormatError;

    fn from_str(word: &str) -> Result<Self, FormatError> {
        Self::ALL.into_iter().find(|split| split.name() == word).ok_or_else(|| {
            FormatError::UnknownName {
                word: word.to_owned(),
                what: "split",
                choices: "train, test".to_owned(),
            }
        })
    }
}
