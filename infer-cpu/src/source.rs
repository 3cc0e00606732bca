//! Where a model comes from.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::WeightsFile;

/// A model file, or its bytes in memory.
#[derive(Clone, Debug)]
pub enum ModelSource {
    /// A file, which is read when the model is loaded.
    File(PathBuf),
    /// The bytes of a file, and the name that errors give them.
    Memory {
        /// What errors call it.
        name: PathBuf,
        /// What a model file holds.
        bytes: Arc<[u8]>,
    },
}

impl ModelSource {
    /// The bytes of a model file, such as a program embeds.
    pub fn from_bytes(bytes: &[u8]) -> Self {
        Self::Memory { name: PathBuf::from("model in memory"), bytes: bytes.into() }
    }

    /// The same source with a file's bytes in memory.
    ///
    /// # Errors
    /// A file that cannot be read or is not safetensors.
    pub fn into_memory(self) -> Result<Self, FormatError> {
        match self {
            Self::File(name) => {
                // A huge file that is not a model is refused by its header.
                WeightsFile::open(&name)?;
                let bytes = fs::read(&name).map_err(|source| FormatError::io(&name, source))?;
                Ok(Self::Memory { name, bytes: bytes.into() })
            }
            memory @ Self::Memory { .. } => Ok(memory),
        }
    }

    /// What errors call the model.
    pub fn name(&self) -> &Path {
        match self {
            Self::File(name) | Self::Memory { name, .. } => name,
        }
    }

    /// The tensors, and what the model says about itself.
    ///
    /// # Errors
    /// A file that cannot be read, is not safetensors, or has metadata that
    /// does not describe a model.
    pub fn open(&self) -> Result<(WeightsFile, ModelCard), FormatError> {
        let file = match self {
            Self::File(path) => WeightsFile::open(path)?,
            Self::Memory { name, bytes } => WeightsFile::from_bytes(name, Arc::clone(bytes))?,
        };
        let card = ModelCard::from_metadata(self.name(), &file.metadata())?;
        Ok((file, card))
    }
}
