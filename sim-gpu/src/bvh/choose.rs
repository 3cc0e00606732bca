//! Which builder pays.

use super::Builder;

impl Builder {
    /// The builder for a mesh of `triangles` at which `rays` will be cast.
    #[must_use]
    pub fn for_rays(triangles: usize, rays: usize) -> Self {
        if rays < 4 * triangles { Self::Morton } else { Self::Sah }
    }
}
