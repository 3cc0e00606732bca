//! The choice of a builder.

use super::Builder;

/// The rays per triangle above which a better tree saves more time than it takes longer to build,
/// as measured in `assets/bench/2026-11-21-xeon-2vcpu/builders.txt`.
const RAYS_PER_TRIANGLE_TO_BREAK_EVEN: usize = 4;

impl Builder {
    /// The builder that takes the least CPU time to build a tree of `triangles` and trace `rays`.
    #[must_use]
    pub fn for_rays(triangles: usize, rays: usize) -> Self {
        if rays / RAYS_PER_TRIANGLE_TO_BREAK_EVEN > triangles { Self::Sah } else { Self::Morton }
    }
}
