//! What the loops need of an instruction set's vectors.

use half::f16;

/// A vector of f32 and one of i32 of as many lanes.
///
/// # Safety
/// This is the contract of every function: the machine has the instruction set
/// of the implementor, and at a pointer are [`Lanes::N`] elements. The first
/// holds because only the functions that [`super::entries`] makes call into
/// this module, and a table of them is given out where the machine was found to
/// have the instructions. The second holds by the invariants of `Rows`, `Panels`
/// and `Columns`, which the loops check or cite.
pub(in crate::kernel) trait Lanes: Copy {
    /// As many lanes of i32.
    type Int: Copy;
    /// How many lanes.
    const N: usize;
    /// Rows of a tile.
    const ROWS: usize;

    unsafe fn splat(value: f32) -> Self;
    unsafe fn load(from: *const f32) -> Self;
    unsafe fn load_f16(from: *const f16) -> Self;
    unsafe fn load_i8(from: *const i8) -> Self;
    unsafe fn store(self, to: *mut f32);
    unsafe fn store_f16(self, to: *mut f16);
    /// Stores integers in 0..=127 as bytes.
    unsafe fn store_u8(self, to: *mut u8);
    /// `self * factor + term`, rounded once.
    unsafe fn fma(self, factor: Self, term: Self) -> Self;
    unsafe fn mul(self, other: Self) -> Self;
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    /// The larger; `other` if either is NaN.
    unsafe fn max(self, other: Self) -> Self;
    /// The smaller; `other` if either is NaN.
    unsafe fn min(self, other: Self) -> Self;
    unsafe fn abs(self) -> Self;
    /// To the nearest integer, ties to even.
    unsafe fn round(self) -> Self;
    /// Which lanes are greater than those of `other`, a bit each.
    unsafe fn greater(self, other: Self) -> u32;
    /// The sum of all lanes, in a fixed order.
    unsafe fn total(self) -> f32;
    /// Where `self` is greater than `best`: puts it there, and `index` into
    /// `who`.
    unsafe fn keep_greater(self, best: &mut Self, who: &mut Self::Int, index: Self::Int);

    unsafe fn splat_int(value: i32) -> Self::Int;
    unsafe fn load_int(from: *const i32) -> Self::Int;
    unsafe fn store_int(int: Self::Int, to: *mut i32);
    unsafe fn add_int(a: Self::Int, b: Self::Int) -> Self::Int;
    unsafe fn max_int(a: Self::Int, b: Self::Int) -> Self::Int;
    unsafe fn keep_greater_int(
        value: Self::Int,
        best: &mut Self::Int,
        who: &mut Self::Int,
        index: Self::Int,
    );
    /// Adds to each lane of `sum` the products of four unsigned bytes (at most
    /// 127) and four signed ones.
    unsafe fn dot4(sum: Self::Int, a: Self::Int, w: Self::Int) -> Self::Int;
    unsafe fn to_float(int: Self::Int) -> Self;
}

/// A weight that a kernel reads as f32.
///
/// # Safety
/// The contract of [`Lanes`].
pub(in crate::kernel) trait Weight: Copy + Default {
    unsafe fn lanes<L: Lanes>(from: *const Self) -> L;
}

impl Weight for f32 {
    #[inline(always)]
    unsafe fn lanes<L: Lanes>(from: *const f32) -> L {
        // SAFETY: the contract of `Lanes`.
        unsafe { L::load(from) }
    }
}

impl Weight for f16 {
    #[inline(always)]
    unsafe fn lanes<L: Lanes>(from: *const f16) -> L {
        // SAFETY: the contract of `Lanes`.
        unsafe { L::load_f16(from) }
    }
}

impl Weight for i8 {
    #[inline(always)]
    unsafe fn lanes<L: Lanes>(from: *const i8) -> L {
        // SAFETY: the contract of `Lanes`.
        unsafe { L::load_i8(from) }
    }
}

/// Implements [`Lanes`] for a vector: a function a line, each of which is one
/// expression of intrinsics.
macro_rules! implement_lanes {
    ($vector:ty, int: $int:ty, lanes: $n:literal, rows: $rows:literal, {
        $(fn $name:ident($($arguments:tt)*) $(-> $out:ty)? = $body:expr;)*
    }) => {
        impl Lanes for $vector {
            type Int = $int;
            const N: usize = $n;
            const ROWS: usize = $rows;
            $(
                #[inline(always)]
                unsafe fn $name($($arguments)*) $(-> $out)? {
                    // SAFETY: the contract of `Lanes`: the machine has the instructions,
                    // and a whole vector lies at a pointer.
                    unsafe { $body }
                }
            )*
        }
    };
}
pub(in crate::kernel) use implement_lanes;
