//! Disjoint sets of points that are added and removed.

use crate::segmentation::Extent;

/// Stands for no point, and for no step.
pub const NONE: u32 = u32::MAX;
/// Each point has a step to each of three sides. Those of points in one cell, to each other, are
/// more where many share cells; without room for them, such points still are one set.
pub const STEPS_PER_POINT: usize = 3;

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
    /// The steps used so far, with room for [`STEPS_PER_POINT`] each.
    steps: Vec<Step>,
    /// The first free step; each free step names the next one.
    free_step: u32,
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
    /// The last column from which a step may still reach it.
    pub last_place: u64,
    /// From this level on, the point is in a set that is too wide for a node.
    pub wide_from: u8,
    /// The first of its steps.
    steps: u32,
    /// [`NONE`] of a free slot.
    parent: u32,
    /// The next point of its set, or the next free slot.
    next: u32,
    /// The next point in a list that the owner keeps.
    pub link: u32,
}

/// A step from a point to another one of its set.
#[derive(Clone, Copy)]
struct Step {
    other: u32,
    level: u8,
    /// The next step of the same point, or the next free step.
    next: u32,
}

#[derive(Clone, Copy, Default)]
pub struct Set {
    pub extent: Extent,
    /// The column of its first point.
    pub first_place: u64,
    /// The last column from which a return may still be linked to it.
    pub last_place: u64,
    /// Its nodes have been looked for up to this column.
    pub seen_place: u64,
    /// Whether parts of it have been removed.
    pub is_thinned: bool,
}

impl Set {
    fn add(&mut self, other: &Self) {
        self.extent.add(&other.extent);
        self.first_place = self.first_place.min(other.first_place);
        self.last_place = self.last_place.max(other.last_place);
        self.seen_place = self.seen_place.min(other.seen_place);
        self.is_thinned |= other.is_thinned;
    }
}

impl<T> Slot<T> {
    /// The point as a set of its own.
    fn set(&self) -> Set {
        Set {
            extent: Extent::at(self.position),
            first_place: self.place,
            last_place: self.last_place,
            seen_place: self.place,
            is_thinned: false,
        }
    }
}

impl<T: Copy + Default> OpenSets<T> {
    pub fn new(capacity: u32) -> Self {
        Self {
            slots: Vec::with_capacity(capacity as usize),
            sets: Vec::with_capacity(capacity as usize),
            capacity,
            free: NONE,
            steps: Vec::with_capacity(STEPS_PER_POINT * capacity as usize),
            free_step: NONE,
            n_points: 0,
        }
    }

    /// Adds a point as a set of its own; `None` if there is no room. [`OpenSets::wait_until`] then
    /// says how long links to it are possible.
    pub fn insert(&mut self, position: [f32; 3], row: u16, tag: T, place: u64) -> Option<u32> {
        let n_used = self.slots.len() as u32;
        let point = if self.free == NONE { n_used } else { self.free };
        let (order, parent, next) = (self.n_points, point, point);
        let (last_place, wide_from) = (place, u8::MAX);
        let (steps, link) = (NONE, NONE);
        let slot = Slot {
            position,
            row,
            tag,
            order,
            place,
            last_place,
            wide_from,
            steps,
            parent,
            next,
            link,
        };
        let set = slot.set();
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
        self.slots[point as usize].last_place = place;
        self.sets[point as usize].last_place = place;
    }

    /// Joins the sets of two points by a step of this level.
    pub fn step(&mut self, level: usize, [a, b]: [u32; 2]) {
        let (Some(root), Some(other)) = (self.root(a), self.root(b)) else { return };
        let n_used = self.steps.len() as u32;
        let at = if self.free_step == NONE { n_used } else { self.free_step };
        let steps = std::mem::replace(&mut self.slots[a as usize].steps, at);
        let step = Step { other: b, level: level as u8, next: steps };
        if at < n_used {
            self.free_step = self.steps[at as usize].next;
            self.steps[at as usize] = step;
        } else if self.steps.len() < self.steps.capacity() {
            self.steps.push(step);
        } else {
            self.slots[a as usize].steps = steps;
        }
        self.join(root, other);
    }

    /// The steps from a point: the level of each, and the other point.
    pub fn steps(&self, point: u32) -> impl Iterator<Item = (usize, u32)> {
        let mut next = self.slots[point as usize].steps;
        std::iter::from_fn(move || {
            let Step { other, level, next: after } = *self.steps.get(next as usize)?;
            next = after;
            Some((level.into(), other))
        })
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

    /// Removes a point that no step of another one reaches any more.
    pub fn remove(&mut self, point: u32) {
        let slot = &mut self.slots[point as usize];
        (slot.parent, slot.next) = (NONE, self.free);
        self.free = point;
        let mut next = std::mem::replace(&mut slot.steps, NONE);
        while next != NONE {
            next = self.free_step(next);
        }
    }

    /// Frees a step, and returns the one after it.
    fn free_step(&mut self, at: u32) -> u32 {
        let step = &mut self.steps[at as usize];
        let after = std::mem::replace(&mut step.next, self.free_step);
        self.free_step = at;
        after
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

    /// Removes those of `points`, which are a set, for which `wide_from` is `None`. The others are
    /// the sets that their steps join, and have been looked at up to the column `seen_place`.
    pub fn thin(
        &mut self,
        points: impl Iterator<Item = u32> + Clone,
        wide_from: impl Fn(u32) -> Option<u8>,
        seen_place: u64,
    ) {
        for point in points.clone() {
            let slot = &mut self.slots[point as usize];
            (slot.parent, slot.next) = (point, point);
            slot.wide_from = wide_from(point).unwrap_or_default();
            self.sets[point as usize] = Set { seen_place, is_thinned: true, ..slot.set() };
        }
        for point in points.clone().filter(|&point| wide_from(point).is_some()) {
            let mut next = std::mem::replace(&mut self.slots[point as usize].steps, NONE);
            while next != NONE {
                let other = self.steps[next as usize].other;
                if wide_from(other).is_none() {
                    next = self.free_step(next);
                    continue;
                }
                let slot = &mut self.slots[point as usize];
                let first = std::mem::replace(&mut slot.steps, next);
                next = std::mem::replace(&mut self.steps[next as usize].next, first);
                self.join(point, other);
            }
        }
        points.filter(|&point| wide_from(point).is_none()).for_each(|point| self.remove(point));
    }

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

    /// Seven points in a row, each a step from the next; the third and the fourth are removed.
    #[test]
    fn thinned_sets_are_joined_by_the_remaining_steps() {
        let mut points = OpenSets::<()>::new(10);
        for place in 0..7u16 {
            let point = points.insert([f32::from(place), 0.0, 0.0], 0, (), place.into()).unwrap();
            points.wait_until(point, 9);
            if place > 0 {
                points.step(3, [point, point - 1]);
            }
        }
        let root = points.root(0).unwrap();
        let Set { extent, first_place, last_place, is_thinned, .. } = *points.set(root);
        assert_eq!((extent.count, first_place, last_place, is_thinned), (7, 0, 9, false));
        let wide_from = |point| (!(2..4).contains(&point)).then_some(5);
        points.thin(0..7, wide_from, 8);
        assert!(points.root(2).is_none() && points.root(3).is_none());
        for left in [&[0, 1][..], &[4, 5, 6]] {
            let root = points.root(left[0]).unwrap();
            let mut members: Vec<_> = points.members(root).collect();
            members.sort_unstable();
            assert_eq!(members, left);
            assert!(left.iter().all(|&point| points.slot(point).wide_from == 5));
            let Set { first_place, last_place, seen_place, is_thinned, .. } = *points.set(root);
            assert_eq!((first_place, last_place), (left[0].into(), 9));
            assert!(is_thinned && seen_place == 8);
        }
        // Only steps between those that are left.
        let steps: Vec<_> = (0..7).flat_map(|point| points.steps(point)).collect();
        assert_eq!(steps, [(3, 0), (3, 4), (3, 5)]);
        // Their room is free again.
        assert!((0..5).all(|_| points.insert([0.0; 3], 0, (), 8).is_some()));
        assert_eq!(points.insert([0.0; 3], 0, (), 8), None);
    }
}
