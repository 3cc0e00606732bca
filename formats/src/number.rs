//! Numbers as binary files hold them.

/// The type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

/// Which of a number's bytes comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteOrder {
    /// The lowest.
    Little,
    /// The highest.
    Big,
}

/// A number of Rust's that files hold as it is.
pub(crate) trait Number: Copy {
    /// Its type in files.
    const TYPE: NumberType;
    /// Its bytes, lowest first.
    fn to_little_endian(self) -> impl AsRef<[u8]>;
    /// The number at the start of `bytes`, which hold at least one.
    fn from_bytes(bytes: &[u8], order: ByteOrder) -> Self;
}

macro_rules! numbers {
    ($($number:ty: $kind:ident),*) => {$(
        impl Number for $number {
            const TYPE: NumberType = NumberType::$kind;

            fn to_little_endian(self) -> impl AsRef<[u8]> {
                self.to_le_bytes()
            }

            fn from_bytes(bytes: &[u8], order: ByteOrder) -> Self {
                let mut own = [0; size_of::<Self>()];
                own.copy_from_slice(&bytes[..size_of::<Self>()]);
                match order {
                    ByteOrder::Little => Self::from_le_bytes(own),
                    ByteOrder::Big => Self::from_be_bytes(own),
                }
            }
        }
    )*};
}

numbers!(i8: I8, u8: U8, i16: I16, u16: U16, i32: I32, u32: U32, i64: I64, u64: U64, f32: F32, f64: F64);

impl NumberType {
    /// Bytes that one number takes.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number at the start of `bytes`, which hold at least one. Whole
    /// numbers beyond 2^53 are rounded.
    pub fn decode(self, bytes: &[u8], order: ByteOrder) -> f64 {
        match self {
            Self::I8 => i8::from_bytes(bytes, order).into(),
            Self::U8 => u8::from_bytes(bytes, order).into(),
            Self::I16 => i16::from_bytes(bytes, order).into(),
            Self::U16 => u16::from_bytes(bytes, order).into(),
            Self::I32 => i32::from_bytes(bytes, order).into(),
            Self::U32 => u32::from_bytes(bytes, order).into(),
            Self::I64 => i64::from_bytes(bytes, order) as f64,
            Self::U64 => u64::from_bytes(bytes, order) as f64,
            Self::F16 => half_to_f64(u16::from_bytes(bytes, order)),
            Self::F32 => f32::from_bytes(bytes, order).into(),
            Self::F64 => f64::from_bytes(bytes, order),
        }
    }
}

/// IEEE 754's binary16 as f64, which holds every one of them exactly.
fn half_to_f64(bits: u16) -> f64 {
    const FRACTION_BITS: u32 = 10;
    let fraction = f64::from(bits & 0x3ff);
    let magnitude = match i32::from(bits >> FRACTION_BITS & 0x1f) {
        // Subnormal: the fraction counts steps of 2^-24.
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        exponent => (1024.0 + fraction) * 2f64.powi(exponent - 15 - FRACTION_BITS as i32),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values from IEEE 754-2019, table 3.5, and from NumPy.
    #[test]
    fn half_precision_is_exact() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x0001, 2f64.powi(-24)),
            (0x03ff, 1023.0 * 2f64.powi(-24)),
            (0x0400, 2f64.powi(-14)),
            (0x3555, 0.333251953125),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x7c00, f64::INFINITY),
            (0xfc00, f64::NEG_INFINITY),
        ] {
            assert_eq!(half_to_f64(bits), value, "{bits:#x}");
        }
        assert!(half_to_f64(0x8000).is_sign_negative());
        assert!(half_to_f64(0x7e00).is_nan());
    }

    /// Between two neighbours of one sign nothing is skipped and nothing is
    /// out of order.
    #[test]
    fn half_precision_grows_with_its_bits() {
        for bits in 0..0x7c00 {
            assert!(half_to_f64(bits) < half_to_f64(bits + 1), "{bits:#x}");
            assert_eq!(half_to_f64(bits | 0x8000), -half_to_f64(bits));
        }
    }

    #[test]
    fn the_order_of_bytes_is_heeded() {
        let bytes = [0x12, 0x34, 0, 0, 0, 0, 0, 0x80];
        assert_eq!(NumberType::U16.decode(&bytes, ByteOrder::Little), 13_330.0);
        assert_eq!(NumberType::U16.decode(&bytes, ByteOrder::Big), 4_660.0);
        assert_eq!(NumberType::I64.decode(&bytes, ByteOrder::Little), 13_330.0 - 2f64.powi(63));
    }
}
