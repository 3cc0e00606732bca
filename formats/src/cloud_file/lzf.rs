//! Decompresses LZF, the compression of PCD files.
//!
//! Marc Lehmann's format: a control byte c below 32 is followed by c + 1 literal
//! bytes. Any other control byte is a copy of earlier output. Its upper three bits
//! are the length (if 7, the next byte is added), and its lower five bits and the
//! next byte are the distance.

use std::io;

use crate::decoding::invalid;

/// Decompresses `compressed` to `n` bytes. Memory grows with the output; one byte of input gives at
/// most 88 bytes.
pub(super) fn decompress(compressed: &[u8], n: u64) -> io::Result<Vec<u8>> {
    let mut output = Vec::new();
    let mut input = compressed.iter().copied();
    let mut next = || input.next().ok_or_else(|| invalid("the LZF data end too early"));
    while (output.len() as u64) < n {
        let control = usize::from(next()?);
        if control < 32 {
            for _ in 0..=control {
                output.push(next()?);
            }
            continue;
        }
        let length = match control >> 5 {
            7 => 7 + usize::from(next()?),
            length => length,
        };
        let distance = ((control & 0x1f) << 8) + usize::from(next()?) + 1;
        let start = output.len().checked_sub(distance);
        let start = start.ok_or_else(|| invalid("an LZF copy begins before the data"))?;
        // The copy may overlap its own output.
        for i in start..start + length + 2 {
            output.push(output[i]);
        }
    }
    if output.len() as u64 > n {
        return Err(invalid(format!("expected {n} bytes of LZF data, found more")));
    }
    Ok(output)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn copies_reach_back_and_into_themselves() {
        // Literals `ab`; 2 + 1 bytes from 2 back; 2 + 7 + 3 from 1 back.
        let compressed = [1, b'a', b'b', 1 << 5, 1, 7 << 5, 3, 0];
        assert_eq!(decompress(&compressed, 17).unwrap(), b"ababaaaaaaaaaaaaa");
        assert!(decompress(&compressed, 16).is_err());
        assert!(decompress(&compressed, 18).is_err());
        assert!(decompress(&[1 << 5, 0], 3).is_err());
        assert_eq!(decompress(&[], 0).unwrap(), b"");
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..100), n in any::<u64>(),
        ) {
            let _ = decompress(&bytes, n);
        }
    }
}
