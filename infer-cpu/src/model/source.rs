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
    Memory {
        /// Its name in errors.
        name: PathBuf,
        bytes: Arc<[u8]>,
    },
}

impl ModelSource {
    /// The bundled model of this name, else the file at this path.
    ///
    /// # Errors
    /// A word that is neither.
    pub fn of(model: &Path) -> Result<Self, FormatError> {
        #[cfg(feature = "bundled")]
        {
            use edgepuck_assets::MODELS;
            if let Some((_, bytes)) = MODELS.iter().find(|(name, _)| model == Path::new(name)) {
                return Ok(Self::Memory { name: model.to_path_buf(), bytes: Arc::from(*bytes) });
            }
            if model.extension().is_none() && !model.exists() {
                let names = MODELS.map(|(name, _)| name).join(", ");
                let cause = format!("expected a model file, or one of {names}");
                return Err(FormatError::malformed(model, "name", cause));
            }
        }
        Ok(Self::File(model.to_path_buf()))
    }

    pub fn from_bytes(bytes: &[u8]) -> Self {
        Self::Memory { name: PathBuf::from("model in memory"), bytes: bytes.into() }
    }

    /// The model's name in errors.
    pub fn name(&self) -> &Path {
        match self {
            Self::File(name) | Self::Memory { name, .. } => name,
        }
    }

    /// Opens the tensors and reads the card.
    pub fn open(&self) -> Result<(WeightsFile, ModelCard), FormatError> {
        let file = match self {
            Self::File(path) => WeightsFile::open(path)?,
            Self::Memory { name, bytes } => WeightsFile::from_bytes(name, Arc::clone(bytes))?,
        };
        let card = ModelCard::from_metadata(self.name(), &file.metadata())?;
        Ok((file, card))
    }
}
