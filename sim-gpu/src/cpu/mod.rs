//! The CPU twins of the shaders in `shaders/`, file by file under the same
//! names, and the f64 oracle that both are held to.

pub mod effects;
pub mod intersect;
pub mod oracle;
pub mod random;
pub mod trace;
pub mod traverse;
