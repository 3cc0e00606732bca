use std::ffi::c_char;

use edgepuck_ffi::{Status, StatusOf};
use infer_cpu::Error;
use infer_cpu::live::LiveError;
use infer_cpu::sampler::SamplerError;

/// The error of a call.
///
/// cbindgen:ignore
pub(crate) type Failure = edgepuck_ffi::Failure<EdgepuckStatus>;

/// The status of a call. edgepuck_last_error returns a message.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgepuckStatus {
    /// The call succeeded.
    Ok = 0,
    /// A pointer is null, or an array is not aligned for its type.
    BadPointer = 1,
    /// An option has an invalid value, or one that the model does not support.
    BadOption = 2,
    /// The model file cannot be read, or is not a model.
    BadModel = 3,
    /// The cloud has no points, too many, or a coordinate that is not finite.
    BadCloud = 4,
    /// This machine lacks instructions or cannot start threads.
    Unsupported = 5,
    /// The network's arithmetic leaves the range of float on this cloud.
    Overflow = 6,
    /// The caller's buffer is too short.
    BufferTooSmall = 7,
    /// No cloud has been classified yet, or the last one could not be classified.
    NoPrediction = 8,
    /// A defect of this library. The classifier can only be freed.
    Internal = 9,
}

/// The error message of the last failed call of this thread; empty if no call has failed. A
/// successful call does not change it.
///
/// The text is UTF-8, and valid until another call of this thread fails.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_last_error() -> *const c_char {
    edgepuck_ffi::last_error()
}

impl Status for EdgepuckStatus {
    const OK: Self = Self::Ok;
    const BAD_POINTER: Self = Self::BadPointer;
    const INTERNAL: Self = Self::Internal;
}

impl StatusOf<Error> for EdgepuckStatus {
    fn of(error: &Error) -> Self {
        match error {
            Error::Format(_) => Self::BadModel,
            Error::NoPoints
            | Error::NotFinite { .. }
            | Error::TooManyPoints(_)
            | Error::Sampler(SamplerError::TooManyPoints(_)) => Self::BadCloud,
            Error::KernelMissing(_) | Error::KernelPrecision { .. } | Error::Threads { .. } => {
                Self::Unsupported
            }
            Error::Overflow => Self::Overflow,
            Error::Sampler(_)
            | Error::FrontMissing { .. }
            | Error::VotesWithoutDraws(_)
            | Error::TooManyThreads(_)
            | Error::TooMuchRoom(_) => Self::BadOption,
            // Errors of functions that this interface does not have.
            _ => Self::Internal,
        }
    }
}

impl StatusOf<LiveError> for EdgepuckStatus {
    fn of(error: &LiveError) -> Self {
        match error {
            LiveError::Classifier(error) => Self::of(error),
            _ => Self::BadOption,
        }
    }
}
