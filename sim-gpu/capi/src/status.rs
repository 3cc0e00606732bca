use std::ffi::c_char;

use edgepuck_ffi::{Status, StatusOf};
use sim_gpu::Error;

/// The error of a call.
///
/// cbindgen:ignore
pub(crate) type Failure = edgepuck_ffi::Failure<EdgepuckSimStatus>;

/// The status of a call. edgepuck_sim_last_error returns a message.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgepuckSimStatus {
    /// The call succeeded.
    Ok = 0,
    /// A pointer is null, or an array is not aligned for its type or is more than the memory can hold.
    BadPointer = 1,
    /// A mesh cannot be read, has no triangle, a coordinate that is not finite, or an index without
    /// a vertex.
    BadMesh = 2,
    /// There is no such sensor, or its file cannot be read.
    BadSensor = 3,
    /// The text of effects is wrong, or the sensor's profile lacks a value that they need.
    BadEffects = 4,
    /// An instance belongs to another scene.
    BadInstance = 5,
    /// A pose is not finite, or its quaternion is not a rotation.
    BadPose = 6,
    /// Another value is out of its bounds, or an array has another length than others need.
    BadValue = 7,
    /// The caller's buffers are too short.
    BufferTooSmall = 8,
    /// A defect of this library. What was passed to the call can only be freed.
    Internal = 9,
}

/// The error message of the last failed call of this thread; empty if no call has failed. A
/// successful call does not change it.
///
/// The text is UTF-8, and valid until another call of this thread fails.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_sim_last_error() -> *const c_char {
    edgepuck_ffi::last_error()
}

/// The library's version, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_sim_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

impl Status for EdgepuckSimStatus {
    const OK: Self = Self::Ok;
    const BAD_POINTER: Self = Self::BadPointer;
    const INTERNAL: Self = Self::Internal;
}

/// The errors of scans and casts. Meshes and sensors have statuses of their own.
impl StatusOf<Error> for EdgepuckSimStatus {
    fn of(error: &Error) -> Self {
        match error {
            Error::Value(invalid) if invalid.key.starts_with("effects") => Self::BadEffects,
            Error::Value(_) => Self::BadValue,
            _ => Self::Internal,
        }
    }
}
