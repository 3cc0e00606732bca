pub mod bench;
pub mod bin;
pub mod clutter;
pub mod cone;
