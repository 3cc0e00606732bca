//! Disjoint sets of points that are added and removed.

use crate::link::Links;
use crate::segmentation::Extent;

/// Stands for no point.
pub const NONE: u32 = u32::MAX;

/// A disjoint-set forest over the current points, in a fixed number of slots. Each set is also a
/// circular list of its points, so that it can be listed, and two sets can be joined, without a
/// search.
pub struct OpenSets<T> {
    /// The slots used so far, with room for all.
    slots: Vec<Slot<T>>,
    /// The state of each set, at the index of its root.
    sets: Vec<Set>,
    capacity: u32,
    /// The first free slot; each free slot names the next one.
    free: u32,
    n_points: u64,
}

#[derive(Clone, Copy)]
pub struct Slot<T> {
    pub position: [f32; 3],
    pub row: u16,
    pub tag: T,
    /// How many points came before it.
    pub order: u64,
    /// Its column, counted from the start of the stream.
    pub place: u64,
    /// [`NONE`] of a free slot.
    parent: u32,
    /// The next point of its set, or the next free slot.
    next: u32,
    /// The next point in a list that the owner keeps.
    pub link: u32,
}

#[derive(Clone, Copy, Default)]
pub struct Set {
    pub extent: Extent,
    /// The column of its first point.
    pub first_place: u64,
    /// The last column from which a return may still be linked to it.
    pub last_place: u64,
    /// Whether it has been cut because it extends all around the sensor.
    pub is_cut: bool,
}

impl Set {
    fn add(&mut self, other: &Self) {
        self.extent.add(&other.extent);
        self.first_place = self.first_place.min(other.first_place);
        self.last_place = self.last_place.max(other.last_place);
        self.is_cut |= other.is_cut;
    }
}

impl<T: Copy + Default> OpenSets<T> {
    pub fn new(capacity: u32) -> Self {
        Self {
            slots: Vec::with_capacity(capacity as usize),
            sets: Vec::with_capacity(capacity as usize),
            capacity,
            free: NONE,
            n_points: 0,
        }
    }

    /// Adds a point as a set of its own; `None` if there is no room. [`OpenSets::wait_until`] then
    /// says how long links to it are possible.
    pub fn insert(&mut self, position: [f32; 3], row: u16, tag: T, place: u64) -> Option<u32> {
        let n_used = self.slots.len() as u32;
        let point = if self.free == NONE { n_used } else { self.free };
        let (order, parent, next) = (self.n_points, point, point);
        let slot = Slot { position, row, tag, order, place, parent, next, link: NONE };
        let extent = Extent::at(position);
        let set = Set { extent, first_place: place, last_place: place, is_cut: false };
        if point < n_used {
            self.free = self.slots[point as usize].next;
            self.slots[point as usize] = slot;
            self.sets[point as usize] = set;
        } else if n_used < self.capacity {
            self.slots.push(slot);
            self.sets.push(set);
        } else {
            return None;
        }
        self.n_points += 1;
        Some(point)
    }

    pub fn slot(&self, point: u32) -> &Slot<T> {
        &self.slots[point as usize]
    }

    /// The point after `point` in the owner's list.
    pub fn link_mut(&mut self, point: u32) -> &mut u32 {
        &mut self.slots[point as usize].link
    }

    /// Notes that returns up to the column `place` may be linked to `point`, a set of its own.
    pub fn wait_until(&mut self, point: u32, place: u64) {
        self.sets[point as usize].last_place = place;
    }

    /// The root of the set that holds `point`; `None` if the point was removed.
    pub fn root(&mut self, mut point: u32) -> Option<u32> {
        loop {
            let parent = self.slots[point as usize].parent;
            if parent == NONE {
                return None;
            }
            if parent == point {
                return Some(point);
            }
            // Halving the paths keeps them short.
            let grandparent = self.slots[parent as usize].parent;
            self.slots[point as usize].parent = grandparent;
            point = grandparent;
        }
    }

    pub fn set(&self, root: u32) -> &Set {
        &self.sets[root as usize]
    }

    pub fn members(&self, root: u32) -> impl Iterator<Item = u32> {
        let mut next = Some(root);
        std::iter::from_fn(move || {
            let here = next?;
            let after = self.slots[here as usize].next;
            next = (after != root).then_some(after);
            Some(here)
        })
    }

    /// Removes a point that is a set of its own.
    pub fn remove(&mut self, point: u32) {
        let slot = &mut self.slots[point as usize];
        (slot.parent, slot.next) = (NONE, self.free);
        self.free = point;
    }

    pub fn remove_set(&mut self, root: u32) {
        let mut here = self.slots[root as usize].next;
        while here != root {
            let next = self.slots[here as usize].next;
            self.remove(here);
            here = next;
        }
        self.remove(root);
    }

    /// Removes the points of this root's set in columns before `place`, and marks the set as cut.
    pub fn cut(&mut self, root: u32, place: u64) {
        let whole = self.sets[root as usize];
        let mut kept: Option<u32> = None;
        let mut here = self.slots[root as usize].next;
        loop {
            let Slot { next, place: at, position, .. } = self.slots[here as usize];
            if at < place {
                self.remove(here);
            } else {
                (self.slots[here as usize].parent, self.slots[here as usize].next) = (here, here);
                let extent = Extent::at(position);
                self.sets[here as usize] = Set { extent, first_place: at, is_cut: true, ..whole };
                match kept {
                    None => kept = Some(here),
                    Some(kept) => self.join(kept, here),
                }
            }
            if here == root {
                return;
            }
            here = next;
        }
    }
}

impl<T: Copy + Default> Links for OpenSets<T> {
    fn join(&mut self, a: u32, b: u32) {
        let (Some(a), Some(b)) = (self.root(a), self.root(b)) else { return };
        if a == b {
            return;
        }
        let is_larger = self.sets[a as usize].extent.count >= self.sets[b as usize].extent.count;
        let (root, joined) = if is_larger { (a, b) } else { (b, a) };
        self.slots[joined as usize].parent = root;
        let next = self.slots[root as usize].next;
        self.slots[root as usize].next = self.slots[joined as usize].next;
        self.slots[joined as usize].next = next;
        let other = self.sets[joined as usize];
        self.sets[root as usize].add(&other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seven points in a row, one in each column; the first three are cut off.
    #[test]
    fn what_is_cut_keeps_the_later_points_and_is_known_as_cut() {
        let mut points = OpenSets::<()>::new(10);
        for place in 0..7u16 {
            let point = points.insert([f32::from(place), 0.0, 0.0], 0, (), place.into()).unwrap();
            points.wait_until(point, 9);
            points.join(0, point);
        }
        let root = points.root(0).unwrap();
        let Set { extent, first_place, last_place, is_cut } = *points.set(root);
        assert_eq!((extent.count, first_place, last_place, is_cut), (7, 0, 9, false));
        points.cut(root, 3);
        for removed in 0..3 {
            assert_eq!(points.root(removed), None);
        }
        let root = points.root(6).unwrap();
        let mut left: Vec<_> = points.members(root).collect();
        left.sort_unstable();
        assert_eq!(left, [3, 4, 5, 6]);
        let Set { extent, first_place, last_place, is_cut } = *points.set(root);
        assert_eq!((extent.count, first_place, last_place, is_cut), (4, 3, 9, true));
        assert_eq!(extent.middle(), [4.5, 0.0]);
        // Their room is free again.
        assert!((0..6).all(|_| points.insert([0.0; 3], 0, (), 8).is_some()));
        assert_eq!(points.insert([0.0; 3], 0, (), 8), None);
    }
}
