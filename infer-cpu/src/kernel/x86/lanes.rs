//! What the loops need of an instruction set's vectors.

use half::f16;

/// A vector of numbers.
///
/// # Safety
/// This is the contract of every function: the machine has the instruction set
/// of the implementor, and at a pointer are [`Lanes::N`] elements. The first
/// holds because only the functions that [`super::enable`] makes call into
/// this module, and a table of them is given out where the machine was found to
/// have the instructions. The second holds by the invariants of `Rows` and
/// `Panels`, which the loops check or cite.
pub(in crate::kernel) trait Vector: Copy {
    /// What is in a lane.
    type Element: Copy;
    /// As many lanes of f32.
    type Float;
    /// As many lanes of i32.
    type Int: Vector<Element = i32, Float = Self::Float, Int = Self::Int>;

    unsafe fn splat(value: Self::Element) -> Self;
    unsafe fn load(from: *const Self::Element) -> Self;
    unsafe fn store(self, to: *mut Self::Element);
    unsafe fn add(self, other: Self) -> Self;
    /// The larger; `other` if either is NaN.
    unsafe fn max(self, other: Self) -> Self;
    /// Where `self` is greater than `best`: puts it there, and `index` into
    /// `who`.
    unsafe fn keep_greater(self, best: &mut Self, who: &mut Self::Int, index: Self::Int);
    /// The nearest numbers of f32.
    unsafe fn to_float(self) -> Self::Float;
}

/// A vector of f32.
///
/// # Safety
/// The contract of [`Vector`].
pub(in crate::kernel) trait Lanes: Vector<Element = f32, Float = Self> {
    /// How many lanes.
    const N: usize;
    /// Rows of a tile.
    const ROWS: usize;

    unsafe fn load_f16(from: *const f16) -> Self;
    unsafe fn load_i8(from: *const i8) -> Self;
    unsafe fn store_f16(self, to: *mut f16);
    /// Stores integers in 0..=127 as bytes.
    unsafe fn store_u8(self, to: *mut u8);
    /// `self * factor + term`, rounded once.
    unsafe fn fma(self, factor: Self, term: Self) -> Self;
    unsafe fn mul(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    /// The smaller; `other` if either is NaN.
    unsafe fn min(self, other: Self) -> Self;
    unsafe fn abs(self) -> Self;
    /// To the nearest integer, ties to even.
    unsafe fn round(self) -> Self;
    /// Which lanes are greater than those of `other`, a bit each.
    unsafe fn greater(self, other: Self) -> u32;
    /// The sum of all lanes, in a fixed order.
    unsafe fn total(self) -> f32;
    /// Adds to each lane of `sum` the products of four unsigned bytes (at most
    /// 127) and four signed ones.
    unsafe fn dot4(sum: Self::Int, a: Self::Int, w: Self::Int) -> Self::Int;
}

/// A weight that a kernel reads as f32.
///
/// # Safety
/// The contract of [`Vector`].
pub(in crate::kernel) trait Weight: Copy + Default {
    unsafe fn lanes<L: Lanes>(from: *const Self) -> L;
}

macro_rules! weight {
    ($number:ty, $load:ident) => {
        impl Weight for $number {
            #[inline(always)]
            unsafe fn lanes<L: Lanes>(from: *const $number) -> L {
                // SAFETY: the contract of `Vector`.
                unsafe { L::$load(from) }
            }
        }
    };
}

weight!(f32, load);
weight!(f16, load_f16);
weight!(i8, load_i8);

/// Implements [`Vector`] or [`Lanes`]: a function a line, each of which is one
/// expression of intrinsics.
macro_rules! implement {
    ($trait:ident for $vector:ty {
        $(type $type:ident = $is:ty;)*
        $(const $constant:ident = $value:literal;)*
        $(fn $name:ident($($arguments:tt)*) $(-> $out:ty)? = $body:expr;)*
    }) => {
        impl $trait for $vector {
            $(type $type = $is;)*
            $(const $constant: usize = $value;)*
            $(
                #[inline(always)]
                #[allow(unused_unsafe, reason = "floats are their own `to_float`")]
                unsafe fn $name($($arguments)*) $(-> $out)? {
                    // SAFETY: the contract of `Vector`: the machine has the instructions,
                    // and a whole vector lies at a pointer.
                    unsafe { $body }
                }
            )*
        }
    };
}
pub(in crate::kernel) use implement;
