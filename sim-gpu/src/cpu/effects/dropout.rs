//! Lost returns. Twin of `shaders/effects/dropout.wgsl`.

use super::stream::stream_words;
use crate::effects::Dropout;
use formats::rng::StreamKey;

/// Whether `beam`'s return is lost. The probability counts as f32 and the
/// number has 24 bits, so that every adapter drops the same returns.
#[must_use]
pub fn dropout(dropout: &Dropout, stream: StreamKey, beam: u32) -> bool {
    let unit = (stream_words(stream, beam, 2)[0] >> 8) as f32 * (1.0 / 16_777_216.0);
    unit < dropout.probability as f32
}
