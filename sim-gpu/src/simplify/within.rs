//! The proof that one surface lies near another.
//!
//! The distance to a convex set is a convex function, so that its maximum over a triangle is at a
//! corner. Hence if all corners of a piece lie within the bound of the same triangle, all of the
//! piece does. A piece without such a triangle is halved across its longest edge, and each half is
//! proven separately. Nothing is sampled: a proof holds for every point.

use glam::DVec3;
use rayon::prelude::*;

use super::distance::distance_to_triangle;
use crate::bvh::{
    Bounds, Entered, Leaf4, Search, Stack, WIDTH, WideChild, WideNode, boxes_that, traverse,
};
use crate::target::{Surface, Target};

/// Pieces shorter than this part of the bound are not halved further, and fail: the surface is at
/// the very bound.
const SHORTEST_PIECE: f64 = 1.0 / 16.0;

/// The limit of pieces in a proof, per triangle of both surfaces; a proof that needs more fails.
const PIECES_PER_TRIANGLE: usize = 256;

/// The triangles of `surface` that are not proven to lie, with all of their points, within `bound`
/// of the surface of `target`, ascending; all in the same units.
#[must_use]
pub fn beyond(surface: &Surface, target: &Target, bound: f64) -> Vec<u32> {
    const TRIANGLES_PER_TASK: usize = 64;
    let frame = target.surface.frame;
    let proof = Proof {
        target,
        bound: bound / frame.scale,
        most_pieces: PIECES_PER_TRIANGLE * (surface.len() + target.surface.len()),
    };
    let chunks = surface.kept().par_chunks(TRIANGLES_PER_TASK);
    let of_each = chunks.map(|triangles| {
        let mut last = None;
        let mut beyond = triangles.to_vec();
        beyond.retain(|&triangle| {
            let corners = surface.corners(triangle);
            let in_world = corners.map(|p| p * surface.frame.scale + surface.frame.centre);
            !proof.holds(in_world.map(|p| frame.to_unit(p)), &mut last)
        });
        beyond
    });
    of_each.flatten_iter().collect()
}

struct Proof<'a> {
    target: &'a Target,
    bound: f64,
    most_pieces: usize,
}

impl Proof<'_> {
    /// Whether all of `triangle` lies within the bound. `last` is the triangle near the previous
    /// piece: neighbouring pieces often lie near the same one.
    fn holds(&self, triangle: [DVec3; 3], last: &mut Option<u32>) -> bool {
        let mut pieces = vec![triangle];
        let mut looked_at = 0;
        while let Some(piece) = pieces.pop() {
            looked_at += 1;
            if last.is_some_and(|index| self.is_near(piece, index)) {
                continue;
            }
            if let Some(index) = self.one_near(piece) {
                *last = Some(index);
                continue;
            }
            let [p, q, r] = with_longest_edge_first(piece);
            let middle = 0.5 * (p + q);
            let too_short = (p - q).length() < SHORTEST_PIECE * self.bound;
            if too_short || looked_at > self.most_pieces || !self.has_near(middle) {
                return false;
            }
            pieces.extend([[p, middle, r], [middle, q, r]]);
        }
        true
    }

    fn is_near(&self, piece: [DVec3; 3], index: u32) -> bool {
        let corners = self.target.surface.corners(index);
        piece.iter().all(|&corner| distance_to_triangle(corner, corners) <= self.bound)
    }

    fn one_near(&self, piece: [DVec3; 3]) -> Option<u32> {
        self.search(piece, |index| self.is_near(piece, index))
    }

    /// Whether any triangle is near `point`. If not, halving does not help.
    fn has_near(&self, point: DVec3) -> bool {
        self.search([point; 3], |index| {
            distance_to_triangle(point, self.target.surface.corners(index)) <= self.bound
        })
        .is_some()
    }

    /// A triangle that is `fit` among those in boxes that hold all of `piece` if grown by the
    /// bound.
    fn search(&self, [a, b, c]: [DVec3; 3], fit: impl Fn(u32) -> bool) -> Option<u32> {
        let (low, high) = (a.min(b).min(c) + self.bound, a.max(b).max(c) - self.bound);
        let Target { surface, bvh } = self.target;
        let mut search = AnyFit { low, high, fit, found: None };
        if !surface.is_empty() {
            traverse(&bvh.wide, WideChild::ROOT, &mut Stack::default(), &mut search);
        }
        search.found
    }
}

/// Searches for a triangle that is `fit`, in boxes that reach below `low` and above `high`.
struct AnyFit<Fit> {
    low: DVec3,
    high: DVec3,
    fit: Fit,
    found: Option<u32>,
}

impl<Fit: Fn(u32) -> bool> Search for AnyFit<Fit> {
    /// Distances do not matter.
    type Distance = ();

    fn enter(&self, node: &WideNode) -> Entered<()> {
        let holds = |Bounds { min, max }: Bounds| {
            min.as_dvec3().cmple(self.low).all() && max.as_dvec3().cmpge(self.high).all()
        };
        (boxes_that(|i| holds(node.bounds(i))), [(); WIDTH])
    }

    fn matters(&self, (): ()) -> bool {
        self.found.is_none()
    }

    fn visit(&mut self, leaf: &Leaf4) {
        self.found = leaf.indices().iter().copied().find(|&index| (self.fit)(index));
    }
}

fn with_longest_edge_first([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    let edges = [[a, b, c], [b, c, a], [c, a, b]];
    let length = |[p, q, _]: &[DVec3; 3]| (*p - *q).length_squared();
    edges.into_iter().max_by(|e, f| length(e).total_cmp(&length(f))).unwrap_or([a, b, c])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::mesh::TriangleMesh;

    /// A square of 2 m by 2 m in `n` by `n` cells, at the height `z(x, y)`.
    fn plate(n: u32, z: impl Fn(f64, f64) -> f64) -> Surface {
        let mut mesh = TriangleMesh::default();
        for i in 0..=n {
            for j in 0..=n {
                let at = |k: u32| 2.0 * f64::from(k) / f64::from(n) - 1.0;
                mesh.vertices.push(DVec3::new(at(i), at(j), z(at(i), at(j))));
                if i < n && j < n {
                    let [a, b] = [i * (n + 1) + j, (i + 1) * (n + 1) + j];
                    mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
                }
            }
        }
        let kept = (0..mesh.triangles.len() as u32).collect();
        Surface::new(mesh, kept)
    }

    fn proven(surface: &Surface, of: Surface, bound: f64) -> bool {
        beyond(surface, &Target::new(of, Builder::Morton), bound).is_empty()
    }

    #[test]
    fn a_displaced_plate_is_within_its_displacement_and_no_less() {
        let (fine, moved) = (|| plate(40, |_, _| 0.0), || plate(1, |_, _| 0.01));
        assert!(proven(&moved(), fine(), 0.0101));
        assert!(proven(&fine(), moved(), 0.0101));
        assert!(!proven(&moved(), fine(), 0.0099));
        assert!(!proven(&fine(), moved(), 0.0099));
    }

    #[test]
    fn a_bump_between_the_corners_is_found() {
        let bump = |x: f64, y: f64| 0.1 * (-(x * x + y * y) * 200.0).exp();
        // The coarse plate's corners lie on the bumpy one; its middle does not.
        assert!(!proven(&plate(1, |_, _| 0.0), plate(80, bump), 0.01), "no way round the bump");
        assert!(!proven(&plate(80, bump), plate(1, |_, _| 0.0), 0.09));
        assert!(proven(&plate(80, bump), plate(1, |_, _| 0.0), 0.1001));
    }

    #[test]
    fn what_reaches_beyond_an_open_border_is_found() {
        let narrow = || {
            Surface::new(
                TriangleMesh {
                    vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
                    triangles: vec![[0, 1, 2]],
                },
                vec![0],
            )
        };
        assert!(proven(&narrow(), plate(1, |_, _| 0.0), 1e-6));
        assert!(!proven(&plate(1, |_, _| 0.0), narrow(), 1e-6));
    }

    #[test]
    fn nothing_is_near_nothing() {
        let nothing = || Surface::new(TriangleMesh::default(), vec![]);
        assert!(proven(&nothing(), plate(1, |_, _| 0.0), 1.0));
        assert!(!proven(&plate(1, |_, _| 0.0), nothing(), 1e9));
    }
}
