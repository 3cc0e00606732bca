//! Shares of hits among scored objects, in groups.

use std::collections::BTreeMap;

use formats::interval::wilson;

/// The share of hits in a group of objects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Share {
    /// The group's name.
    pub group: String,
    /// Number of hits.
    pub hits: usize,
    /// Number of objects.
    pub n: usize,
}

impl Share {
    /// Hits over objects.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        self.hits as f64 / self.n as f64
    }

    /// The 95 % interval of [`Share::ratio`] (Wilson 1927).
    #[must_use]
    pub fn interval(&self) -> (f64, f64) {
        wilson(self.hits, self.n)
    }
}

/// Gives an object's group: a number that orders the groups, and the group's name. An object that
/// it gives `None` is in no group.
pub type Grouping<'a, T> = dyn Fn(&T) -> Option<(usize, String)> + 'a;

/// The share of hits in each group of `objects`, in the order of the groups. `count` returns the
/// number of hits among some objects and the number of those objects.
pub fn shares<T>(
    objects: &[&T],
    grouping: &Grouping<'_, T>,
    count: impl Fn(&[&T]) -> (usize, usize),
) -> Vec<Share> {
    let mut groups: BTreeMap<(usize, String), Vec<&T>> = BTreeMap::new();
    for &object in objects {
        if let Some(group) = grouping(object) {
            groups.entry(group).or_default().push(object);
        }
    }
    let share = |((_, group), objects): (_, Vec<&T>)| {
        let (hits, n) = count(&objects);
        Share { group, hits, n }
    };
    groups.into_iter().map(share).collect()
}

/// The group of a `value` of 0 or more between two of the ascending `edges`: `10 to 20 m`. A bin
/// includes its lower edge; the last bin has no upper edge.
#[must_use]
pub fn bin(value: f64, edges: &[usize], unit: &str) -> (usize, String) {
    let next = edges.partition_point(|&edge| edge as f64 <= value);
    let low = edges[next - 1];
    let name = match edges.get(next) {
        Some(high) => format!("{low} to {high} {unit}"),
        None => format!("{low} {unit} or more"),
    };
    (next, name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bin_includes_its_lower_edge_and_the_last_is_open() {
        let name = |value| bin(value, &[0, 5, 10], "m").1;
        assert_eq!(name(0.0), "0 to 5 m");
        assert_eq!(name(5.0), "5 to 10 m");
        assert_eq!(name(1e9), "10 m or more");
    }
}
