mod classifier;
mod live;
mod options;
mod prediction;

pub use classifier::*;
pub use live::*;
pub use options::*;
pub use prediction::*;

use infer_cpu::Error;
use infer_cpu::detect::DetectError;
use infer_cpu::sampler::SamplerError;

use crate::status::{EdgepuckStatus, Failure};

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::new(status_of(&error), error.to_string())
    }
}

impl From<DetectError> for Failure {
    fn from(error: DetectError) -> Self {
        match error {
            DetectError::Model(error) => error.into(),
            other => Self::new(EdgepuckStatus::BadValue, other.to_string()),
        }
    }
}

fn status_of(error: &Error) -> EdgepuckStatus {
    match error {
        Error::Format(_) => EdgepuckStatus::BadModel,
        Error::NoPoints
        | Error::NotFinite { .. }
        | Error::TooManyPoints(_)
        | Error::Sampler(SamplerError::TooManyPoints(_)) => EdgepuckStatus::BadCloud,
        Error::KernelMissing(_) | Error::KernelPrecision { .. } | Error::Threads { .. } => {
            EdgepuckStatus::Unsupported
        }
        Error::Overflow => EdgepuckStatus::Overflow,
        Error::Sampler(_)
        | Error::FrontMissing { .. }
        | Error::TooManyThreads(_)
        | Error::TooMuchRoom(_) => EdgepuckStatus::BadValue,
        // Errors of functions that this interface does not have.
        _ => EdgepuckStatus::Internal,
    }
}
