//! Parametric shape families: ten classes named as in ModelNet40, so that a
//! dataset can be made on a machine that has no CAD models.
//!
//! A shape is a pure function of (class, seed, instance). It is drawn in two
//! steps: a class file puts primitives together after proportions of its own
//! random stream, and `finish` wears the result the way CAD collections
//! look: doubled faces, mixed winding, vertices merged or not. Proportions
//! overlap between classes (a wide vase is a bowl), so that a classifier has
//! to learn shapes and not sizes.

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
pub use sampler::Sampler;
pub use tree::{TreeSummary, write_tree};
pub use write::{write_obj, write_off};

use formats::rng::StreamKey;

use finish::Finish;
use sim_gpu::mesh::Mesh;

/// The shape that `seed` and `instance` give in `class`.
///
/// Metres, z up, standing on z = 0 near the origin, azimuth as in ModelNet
/// (chairs face -y, airplanes fly to -y, long tables lie along y) but for a
/// yaw of up to 15 degrees and now and then a quarter or half turn. 200 to
/// 50,000 triangles. Coordinates are whole micrometres, so that text holds
/// them exactly.
#[must_use]
pub fn generate(class: ShapeClass, seed: u64, instance: u32) -> Mesh {
    let stream = |part: &str| StreamKey::new(seed, &format!("shapes/{class}/{part}"), instance);
    let finish = Finish::draw(class, &mut Sampler::new(stream("finish")));
    let builder = tessellation::fit(&finish, |b| {
        class.build(b, &mut Sampler::new(stream("form")));
    });
    finish.apply(builder, &mut Sampler::new(stream("wear")))
}
