//! The vector operations of an instruction set.

/// A vector of numbers.
///
/// # Safety
/// For every function, the machine has the instruction set of the implementor, and a pointer points
/// at [`Lanes::N`] elements. The first holds because only functions of [`super::enable`] call into
/// this module, and `kernels()` gives out their table only where the machine has the instructions.
/// The second follows from the invariants of `Rows` and `Panels`, which the loops check.
pub(crate) trait Vector: Copy {
    /// The number in a lane.
    type Element: Copy;
    /// The vector of f32 with as many lanes.
    type Float;
    /// The vector of i32 with as many lanes.
    type Int: Vector<Element = i32, Float = Self::Float, Int = Self::Int>;

    unsafe fn splat(value: Self::Element) -> Self;
    unsafe fn load(from: *const Self::Element) -> Self;
    unsafe fn store(self, to: *mut Self::Element);
    unsafe fn add(self, other: Self) -> Self;
    /// The larger number of each lane; `other` if either is NaN.
    unsafe fn max(self, other: Self) -> Self;
    /// Where `self` is greater than `best`, sets `best` to it and `who` to `index`.
    unsafe fn keep_greater(self, best: &mut Self, who: &mut Self::Int, index: Self::Int);
    unsafe fn to_float(self) -> Self::Float;
}

/// A vector of f32.
///
/// # Safety
/// As for [`Vector`].
pub(crate) trait Lanes: Vector<Element = f32, Float = Self> {
    /// The number of lanes.
    const N: usize;
    /// The rows of a tile.
    const ROWS: usize;

    unsafe fn load_i8(from: *const i8) -> Self;
    /// Stores integers in 0..=127 as bytes.
    unsafe fn store_u8(self, to: *mut u8);
    /// `self * factor + term`, rounded once where the instruction set can.
    unsafe fn fma(self, factor: Self, term: Self) -> Self;
    unsafe fn mul(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    /// The smaller number of each lane; `other` if either is NaN.
    unsafe fn min(self, other: Self) -> Self;
    /// Rounds to the nearest integer, ties to even.
    unsafe fn round(self) -> Self;
    /// The lanes that are greater than those of `other`, one bit each.
    unsafe fn greater(self, other: Self) -> u32;
    /// The sum of all lanes, in a fixed order.
    unsafe fn total(self) -> f32;
    /// Adds to each lane of `sum` the products of four unsigned bytes (at most 127) and four signed
    /// ones.
    unsafe fn dot4(sum: Self::Int, a: Self::Int, w: Self::Int) -> Self::Int;
}

/// A weight that a kernel reads as f32.
///
/// # Safety
/// As for [`Vector`].
pub(crate) trait Weight: Copy + Default {
    unsafe fn lanes<L: Lanes>(from: *const Self) -> L;
}

macro_rules! weight {
    ($number:ty, $load:ident) => {
        impl Weight for $number {
            #[inline(always)]
            unsafe fn lanes<L: Lanes>(from: *const $number) -> L {
                // SAFETY: as for `Vector`; `Panels` has whole vectors of weights.
                unsafe { L::$load(from) }
            }
        }
    };
}

weight!(f32, load);
weight!(i8, load_i8);

/// Implements [`Vector`] or [`Lanes`] from one expression of intrinsics for each function.
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
                    // SAFETY: `kernels()` gives out these functions only where the machine has the
                    // instructions; `Rows` and `Panels` have whole vectors at the pointers.
                    unsafe { $body }
                }
            )*
        }
    };
}
pub(crate) use implement;
