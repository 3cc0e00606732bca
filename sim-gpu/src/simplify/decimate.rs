//! Decimation by edge collapse, believed only once it is proven.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use meshopt::{SimplifyOptions, simplify_with_locks_decoder};

use super::NotBuilt;
use super::within::{beyond, lies_within};
use crate::bvh::Builder;
use crate::mesh::Mesh;
use crate::mesh::census::survey;
use crate::target::{Surface, Target, UnitFrame};

/// The part of the bound that the decimation is told first. Its errors are
/// means over quadrics, not maxima: told all of the bound, it would go too far
/// in a tenth of all places.
const FIRST_SHARE: f64 = 0.5;

/// What it is told next, of what it was told.
const NEXT_SHARE: f64 = 0.7;

/// Where less than this part of the triangles is out of bounds, these are
/// locked, and it is told the same again.
const FEW: f64 = 0.02;

/// Results that are put to the proof at most.
const ATTEMPTS: usize = 12;

/// A result with more than this part of the triangles is not worth it.
const WORTH_IT: f64 = 0.75;

/// See [`super::simplified`].
pub(super) fn decimated(mesh: &Mesh, kept: &[u32], bound: f64) -> Result<Option<Mesh>, NotBuilt> {
    Ok(proven(mesh, kept, bound))
}

/// Decimates until all of the result is proven to lie near the mesh. Triangles of
/// the mesh that are not proven to lie near the result then become part of it,
/// which they are as near to as can be. None of the result is taken away: that
/// would leave gaps.
fn proven(mesh: &Mesh, kept: &[u32], bound: f64) -> Option<Mesh> {
    if kept.is_empty() || bound.is_nan() || bound <= 0.0 {
        return None;
    }
    let surface = Surface::new(mesh.clone(), kept.to_vec());
    let mut welded = Welded::of(mesh, kept, &surface.frame);
    let most = (WORTH_IT * welded.corners.len() as f64) as usize;
    // No error is larger than the whole mesh, which fits a box of side 2.
    let error = (bound / surface.frame.scale).min(2.0);
    let mut original = None;
    let mut share = FIRST_SHARE;
    for _ in 0..ATTEMPTS {
        let mut corners = welded.collapsed((share * error) as f32);
        if corners.len() > most {
            return None;
        }
        let original =
            original.get_or_insert_with(|| Target::new(surface.clone(), Builder::Morton));
        let fewer = target(&welded.mesh_of(mesh, &corners));
        let strays = !lies_within(&fewer.surface, original, bound);
        let lost = beyond(&original.surface, &fewer, bound);
        let lost: Vec<usize> = lost.iter().filter_map(|t| kept.binary_search(t).ok()).collect();
        if !strays {
            lost.iter().for_each(|&nth| corners.extend(welded.triangle(nth)));
            return (corners.len() <= most).then(|| welded.mesh_of(mesh, &corners));
        }
        if lost.is_empty() || lost.len() as f64 > FEW * kept.len() as f64 {
            share *= NEXT_SHARE;
        } else {
            lost.iter().for_each(|&nth| welded.lock(nth));
        }
    }
    None
}

fn target(mesh: &Mesh) -> Target {
    let kept = survey(mesh).kept;
    Target::new(Surface::new(mesh.clone(), kept), Builder::Morton)
}

/// Triangles whose corners at one position are one vertex: files often repeat
/// a vertex for each face, and nothing would collapse across such a seam.
struct Welded {
    /// In the unit frame, `[n_welded]`.
    positions: Vec<[f32; 3]>,
    /// A vertex of the mesh at each position, `[n_welded]`.
    sources: Vec<u32>,
    /// Indices into `positions`, `[n_kept * 3]`.
    corners: Vec<u32>,
    /// Positions that collapses may not remove, `[n_welded]`.
    locked: Vec<bool>,
}

impl Welded {
    fn of(mesh: &Mesh, kept: &[u32], frame: &UnitFrame) -> Self {
        const NOT_SEEN: u32 = u32::MAX;
        let mut welded = Self {
            positions: Vec::new(),
            sources: Vec::new(),
            corners: Vec::with_capacity(3 * kept.len()),
            locked: Vec::new(),
        };
        let mut by_vertex = vec![NOT_SEEN; mesh.vertices.len()];
        let mut by_position = HashMap::new();
        for &vertex in kept.iter().flat_map(|&t| &mesh.triangles[t as usize]) {
            let welded_vertex = &mut by_vertex[vertex as usize];
            if *welded_vertex == NOT_SEEN {
                // Adding 0 makes -0 and 0 one.
                let position = frame.to_unit(mesh.vertices[vertex as usize]).as_vec3() + 0.0;
                *welded_vertex = match by_position.entry(position.to_array().map(f32::to_bits)) {
                    Entry::Occupied(known) => *known.get(),
                    Entry::Vacant(new) => {
                        welded.positions.push(position.to_array());
                        welded.sources.push(vertex);
                        *new.insert(welded.positions.len() as u32 - 1)
                    }
                };
            }
            welded.corners.push(*welded_vertex);
        }
        welded.locked.resize(welded.positions.len(), false);
        welded
    }

    /// The corners of the `nth` triangle kept.
    fn triangle(&self, nth: usize) -> [u32; 3] {
        [0, 1, 2].map(|corner| self.corners[3 * nth + corner])
    }

    /// Keeps the `nth` triangle's corners where they are.
    fn lock(&mut self, nth: usize) {
        self.triangle(nth).iter().for_each(|&corner| self.locked[corner as usize] = true);
    }

    /// The corners that are left when collapses may displace the surface by
    /// about `error`.
    fn collapsed(&self, error: f32) -> Vec<u32> {
        const AS_FAR_AS_THE_ERROR_ALLOWS: usize = 0;
        let absolute = SimplifyOptions::ErrorAbsolute;
        simplify_with_locks_decoder(
            &self.corners,
            &self.positions,
            &self.locked,
            AS_FAR_AS_THE_ERROR_ALLOWS,
            error,
            absolute,
            None,
        )
    }

    /// The mesh of triangles with these `corners`, at the f64 positions of
    /// `mesh`, and of no other vertices.
    fn mesh_of(&self, mesh: &Mesh, corners: &[u32]) -> Mesh {
        const NOT_USED: u32 = u32::MAX;
        let mut numbers = vec![NOT_USED; self.positions.len()];
        let mut fewer = Mesh::default();
        let mut number = |corner: u32| {
            let number = &mut numbers[corner as usize];
            if *number == NOT_USED {
                *number = fewer.vertices.len() as u32;
                fewer.vertices.push(mesh.vertices[self.sources[corner as usize] as usize]);
            }
            *number
        };
        fewer.triangles =
            corners.as_chunks::<3>().0.iter().map(|triangle| triangle.map(&mut number)).collect();
        fewer
    }
}
