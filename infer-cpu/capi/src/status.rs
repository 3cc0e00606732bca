//! How a call went.

/// How a call went. edgepuck_last_error says more.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgepuckStatus {
    /// It did what was asked.
    Ok = 0,
    /// A pointer is null, or not aligned as its type needs.
    BadPointer = 1,
    /// An option has a value that nothing can be done with, or that the model
    /// cannot meet.
    BadOption = 2,
    /// The model file cannot be read, or is not a model.
    BadModel = 3,
    /// The cloud has no points, too many, or a coordinate that is not finite.
    BadCloud = 4,
    /// This machine cannot do it: it lacks instructions, or threads.
    Unsupported = 5,
    /// The network's arithmetic leaves the range of float on this cloud.
    Overflow = 6,
    /// The caller's buffer is too short.
    BufferTooSmall = 7,
    /// No cloud has been classified yet, or the last could not be.
    NoPrediction = 8,
    /// A defect of this library. The classifier is only good for being freed.
    Internal = 9,
}
