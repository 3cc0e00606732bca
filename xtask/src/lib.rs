//! What the repository's chores share with the laboratory: Cargo, the Raspberry
//! Pi as a target, and Python environments.

pub mod build_pi;
pub mod pi_target;
pub mod venv;
pub mod workspace;
