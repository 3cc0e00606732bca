/// Activations of `n` points: rows that are `stride` apart; the last one may be shorter.
///
/// # Invariant
/// Every row begins within the data: `(n - 1) * stride` does not exceed its length. [`Rows::new`]
/// checks it and the fields are private, so that `Rows::check` cannot wrap.
#[derive(Clone, Copy)]
pub struct Rows<'a, T> {
    data: &'a [T],
    stride: usize,
    n: usize,
}

impl<'a, T> Rows<'a, T> {
    /// `n` rows of `data`, `stride` apart.
    ///
    /// # Panics
    /// If a row begins beyond the data.
    pub fn new(data: &'a [T], stride: usize, n: usize) -> Self {
        assert!(holds_rows(data.len(), n, stride, 0), "rows begin beyond their data");
        Self { data, stride, n }
    }

    /// The rows with what is between them.
    pub fn data(&self) -> &'a [T] {
        self.data
    }

    /// The distance from one row to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The number of rows.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Asserts that every row has `k` elements, which unsafe kernels rely on.
    pub(crate) fn check(&self, k: usize) {
        assert!(holds_rows(self.data.len(), self.n, self.stride, k), "rows end before their width");
    }
}

/// Whether `len` elements hold `n` rows of `width`, `stride` apart.
pub(crate) fn holds_rows(len: usize, n: usize, stride: usize, width: usize) -> bool {
    let Some(before_last) = n.checked_sub(1) else { return true };
    // A product that wraps would pass the comparison.
    let end = before_last.checked_mul(stride).and_then(|last| last.checked_add(width));
    width <= stride && end.is_some_and(|end| end <= len)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::panics_with;

    #[test]
    fn rows_beyond_their_data_are_refused() {
        // Two strides of 2^63 are 2^64, which wraps to 0.
        let half = usize::MAX / 2 + 1;
        panics_with("rows begin beyond", || Rows::new(&[0.0f32; 4], half, 3));
        panics_with("rows begin beyond", || Rows::new(&[0.0f32; 4], 5, 2));
        let rows = Rows::new(&[0.0f32; 4], 2, 2);
        rows.check(2);
        panics_with("rows end before", || rows.check(3));
        panics_with("rows end before", || rows.check(usize::MAX));
        Rows::new(&[0.0f32; 0], 0, 0).check(usize::MAX);
    }
}
