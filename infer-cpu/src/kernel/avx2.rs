//! Under construction.
pub(super) fn kernels() -> Option<&'static super::Kernels> {
    None
}
