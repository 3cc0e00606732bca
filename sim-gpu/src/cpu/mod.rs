//! The CPU twins of the shaders in `shaders/`, in files of the same names, and the f64 oracle
//! that tests compare both with.

pub mod aim;
pub mod effects;
#[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "packets need AVX2"))]
mod frustum;
mod interleaved;
pub mod intersect;
pub mod oracle;
#[cfg(target_arch = "x86_64")]
mod packet;
pub mod random;
pub mod trace;
pub mod traverse;
