//! Which builder pays.

use super::Builder;

/// Rays per triangle at which the better tree has won back what it took
/// longer to build. `cargo xtask bench sim MESHES --builders` prints the
/// figures that this rests on.
const RAYS_PER_TRIANGLE_TO_BREAK_EVEN: usize = 4;

impl Builder {
    /// The builder with which building a tree over `triangles` triangles and
    /// tracing `rays` rays through it take the least CPU time together.
    ///
    /// Both the time to build and what a better tree saves grow with the
    /// number of triangles, the saving far more slowly: so the choice goes by
    /// the rays per triangle alone.
    #[must_use]
    pub fn for_rays(triangles: usize, rays: usize) -> Self {
        if rays / RAYS_PER_TRIANGLE_TO_BREAK_EVEN > triangles { Self::Sah } else { Self::Morton }
    }
}
