//! The choice among the cuts of a tree.

/// Finds the nodes of the best cut of trees, of which none holds another. Its memory is reused.
#[derive(Default)]
pub struct BestCut {
    nodes: Vec<State>,
    kept: Vec<usize>,
}

#[derive(Clone, Copy, Default)]
struct State {
    has_parts: bool,
    /// The worth of the best cut of its parts.
    of_parts: f64,
    is_kept: bool,
}

impl BestCut {
    /// With memory for trees of `n` nodes in all.
    #[must_use]
    pub fn with_capacity(n: usize) -> Self {
        Self { nodes: Vec::with_capacity(n), kept: Vec::with_capacity(n) }
    }

    /// The best cut, by the worth of each node and by its parent, which has a higher number: a node
    /// is kept if its worth is at least `1 + margin` times that of the best cut of those of which it
    /// is made.
    pub fn find(
        &mut self,
        worths: &[f64],
        parent: impl Fn(usize) -> Option<usize>,
        margin: f64,
    ) -> &[usize] {
        let Self { nodes, kept, .. } = self;
        nodes.clear();
        nodes.resize(worths.len(), State::default());
        for (node, &own) in worths.iter().enumerate() {
            let State { has_parts, of_parts, .. } = nodes[node];
            let is_kept = !has_parts || own >= (1.0 + margin) * of_parts;
            nodes[node].is_kept = is_kept;
            if let Some(parent) = parent(node) {
                nodes[parent].has_parts = true;
                nodes[parent].of_parts += if is_kept { own } else { of_parts };
            }
        }
        kept.clear();
        for node in (0..nodes.len()).rev() {
            // What is kept hides its parts.
            let is_hidden = parent(node).is_some_and(|parent| nodes[parent].is_kept);
            if nodes[node].is_kept && !is_hidden {
                kept.push(node);
            }
            nodes[node].is_kept |= is_hidden;
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes 0 and 1 make 2, which makes 4 with 3. A node of 1.1 times the worth of the best cut of its
    /// parts, however deep that is, takes their place.
    #[test]
    fn the_cut_is_the_best_at_all_levels() {
        let parents = [Some(2), Some(2), Some(4), Some(4), None];
        for (worths, expected) in [
            ([1.0, 1.0, 1.5, 1.0, 3.29], &[0, 1, 3][..]),
            ([1.0, 1.0, 1.5, 1.0, 3.31], &[4]),
            ([1.0, 1.0, 2.3, 1.0, 3.62], &[2, 3]),
            ([1.0, 1.0, 2.3, 1.0, 3.64], &[4]),
        ] {
            let mut best = BestCut::default();
            let mut found = best.find(&worths, |node| parents[node], 0.1).to_vec();
            found.sort_unstable();
            assert_eq!(found, expected, "{worths:?}");
        }
    }
}
