//! Limits of the numbers in a recipe.

/// Whether a value is within its limits, its key in the recipe, and the values that are expected
/// there.
pub(crate) type Check = (bool, &'static str, &'static str);

pub(crate) fn non_negative(key: &'static str, x: f64) -> Check {
    (x.is_finite() && x >= 0.0, key, "expected a finite number of 0 or more")
}

pub(crate) fn positive(key: &'static str, x: f64) -> Check {
    (x.is_finite() && x > 0.0, key, "expected a finite number above 0")
}

pub(crate) fn share_below_1(key: &'static str, x: f64) -> Check {
    ((0.0..1.0).contains(&x), key, "expected 0 or more, and less than 1")
}

pub(crate) fn share(key: &'static str, x: f64) -> Check {
    ((0.0..=1.0).contains(&x), key, "expected 0 to 1")
}

pub(crate) fn layers(key: &'static str, n: usize, least: usize) -> Check {
    let expected =
        if least == 1 { "expected 1 layer or more" } else { "expected 2 layers or more" };
    (n >= least, key, expected)
}

/// Widths of layers. Wider layers are refused as a mistake.
pub(crate) fn widths(key: &'static str, mut widths: impl Iterator<Item = usize>) -> Check {
    (widths.all(|width| (1..=8192).contains(&width)), key, "expected widths of 1 to 8192")
}
