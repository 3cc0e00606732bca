/// The status of a call. edgepuck_last_error returns a message.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgepuckStatus {
    /// The call succeeded.
    Ok = 0,
    /// A pointer is null, or not aligned for its type.
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
