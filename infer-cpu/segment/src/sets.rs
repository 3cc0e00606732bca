use crate::link::Links;

/// A disjoint-set forest; the root of a set is its first point, in any order of the links.
#[derive(Default)]
pub struct Sets {
    parents: Vec<u32>,
}

impl Sets {
    /// Makes `n` sets of one point each.
    pub fn reset(&mut self, n: usize) {
        self.parents.clear();
        self.parents.extend(0..n as u32);
    }

    /// The first point of the set that holds `point`.
    pub fn first(&mut self, point: u32) -> u32 {
        root(&mut self.parents, point)
    }
}

/// The root of the tree that holds `point`, of a forest in which each point has a parent; a root is
/// its own.
pub fn root(parents: &mut [u32], mut point: u32) -> u32 {
    loop {
        let parent = parents[point as usize];
        if parent == point {
            return point;
        }
        // Halving the paths keeps them short.
        let grandparent = parents[parent as usize];
        parents[point as usize] = grandparent;
        point = grandparent;
    }
}

impl Links for Sets {
    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.first(a), self.first(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_known_by_its_first_point() {
        let mut sets = Sets::default();
        sets.reset(6);
        sets.join(5, 3);
        sets.join(4, 5);
        sets.join(2, 2);
        let firsts: Vec<_> = (0..6).map(|point| sets.first(point)).collect();
        assert_eq!(firsts, [0, 1, 2, 3, 3, 3]);
    }
}
