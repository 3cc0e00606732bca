//! Procedural meshes of ten classes with ModelNet40's names, for datasets on machines without CAD
//! models, and of [`objects`] of streets and rooms at real size.
//!
//! A shape is a pure function of class, seed and number. [`generate`] makes it in two steps. The
//! class draws proportions from the random stream of the shape and builds it from primitives. Then
//! `finish` gives the mesh the defects of CAD collections: doubled faces, mixed winding, vertices
//! that are shared or not. The proportions of the classes overlap (a wide vase is a bowl), so that
//! a classifier must learn shapes instead of sizes.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod airplane;
mod bottle;
mod bowl;
mod builder;
mod chair;
mod class;
mod cone;
mod cup;
mod finish;
mod lamp;
mod monitor;
pub mod objects;
mod primitives;
mod sampler;
mod supports;
mod table;
mod tessellation;
mod tree;
mod vase;
mod write;

#[cfg(test)]
mod tests;

pub use class::ShapeClass;
#[doc(hidden)]
pub use sampler::Sampler;
pub use tree::write_tree;
pub use write::{write_obj, write_off};

use formats::streams::Stream;

use class::FAMILIES;
use edgepuck_mesh::TriangleMesh;
use finish::Finish;
use primitives::build_one;

/// Generates shape number `instance` of `class` under `seed`.
///
/// The mesh stands on z = 0 near the origin; lengths are metres, z is up. Directions follow
/// ModelNet: chairs face -y, airplanes fly to -y, long tables lie along y; a yaw of up to 15
/// degrees, and sometimes a quarter or half turn, is added. The mesh has 200 to 50,000 triangles.
/// Coordinates are whole micrometres, so that text holds them exactly.
#[must_use]
pub fn generate(class: ShapeClass, seed: u64, instance: u32) -> TriangleMesh {
    let stream = |part| Stream::Shape { class: class.name(), part, instance }.key(seed);
    let finish = Finish::draw(class, &mut Sampler::new(stream("finish")));
    let builder = tessellation::fit(&finish, |b| {
        build_one(FAMILIES[class as usize].0, b, &mut Sampler::new(stream("form")));
    });
    finish.apply(builder, &mut Sampler::new(stream("wear")))
}
