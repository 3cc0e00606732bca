//! Numbers in binary files.

use half::f16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteOrder {
    Little,
    Big,
}

/// A number of Rust that files hold without conversion.
pub(crate) trait Number: Copy {
    const TYPE: NumberType;
    fn to_little_endian(self) -> impl AsRef<[u8]>;
    /// The number at the start of `bytes`, which must hold at least one.
    fn from_bytes(bytes: &[u8], order: ByteOrder) -> Self;
}

/// Declares the types of numbers: in Rust, here, in NumPy (without the byte order), and the
/// conversion to f64.
macro_rules! numbers {
    ($($number:ty: $kind:ident, $numpy:literal, $x:ident => $f64:expr;)*) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum NumberType {
            $($kind,)*
        }

        impl NumberType {
            pub fn size(self) -> usize {
                match self {
                    $(Self::$kind => size_of::<$number>(),)*
                }
            }

            /// The number at the start of `bytes`, which must hold at least one. Whole
            /// numbers beyond 2^53 are rounded.
            pub fn decode(self, bytes: &[u8], order: ByteOrder) -> f64 {
                match self {
                    $(Self::$kind => {
                        let $x = <$number>::from_bytes(bytes, order);
                        $f64
                    })*
                }
            }

            pub fn numpy(self) -> &'static str {
                match self {
                    $(Self::$kind => $numpy,)*
                }
            }

            pub fn of_numpy(name: &str) -> Option<Self> {
                match name {
                    $($numpy => Some(Self::$kind),)*
                    _ => None,
                }
            }
        }

        $(impl Number for $number {
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
        })*
    };
}

numbers! {
    i8: I8, "i1", x => x.into();
    u8: U8, "u1", x => x.into();
    i16: I16, "i2", x => x.into();
    u16: U16, "u2", x => x.into();
    i32: I32, "i4", x => x.into();
    u32: U32, "u4", x => x.into();
    i64: I64, "i8", x => x as f64;
    u64: U64, "u8", x => x as f64;
    f16: F16, "f2", x => x.into();
    f32: F32, "f4", x => x.into();
    f64: F64, "f8", x => x;
}
