//! Scans three boxes with two sensors and 2 cm of noise, moves one box, and scans again:
//! `cargo run --release --example scan_scene`

use sim_gpu::effects::Noise;
use sim_gpu::{Attribute, Caster, Effects, Error, Mesh, Pose, Scene, Sensor};

fn main() -> Result<(), Error> {
    let cuboid = cuboid()?;
    let mut scene = Scene::new();
    let floor = scene.add(&cuboid, Pose::at([0.0, 0.0, -0.05]));
    scene[floor].scale = [20.0, 20.0, 0.1].into();
    scene[floor].reflectivity = 0.2;
    let cabinet = scene.add(&cuboid, Pose::at([3.0, 0.0, 1.0]).turned_deg(30.0, 0.0, 0.0));
    scene[cabinet].scale = [1.0, 0.5, 2.0].into();
    let parcel = scene.add(&cuboid, Pose::at([2.0, 1.5, 0.25]));
    scene[parcel].scale = [0.5; 3].into();

    scene.effects = Effects { noise: Some(Noise::along_range(0.02)), ..Effects::default() };
    scene.attributes = [Attribute::Range, Attribute::Object, Attribute::Intensity].into();
    scene.mount("roof", &Sensor::named("vlp32c")?, Pose::at([0.0, 0.0, 1.8]));
    scene.mount("front", &Sensor::named("vlp16")?, Pose::at([0.5, 0.0, 0.6]));

    let caster = Caster::auto();
    for step in 0..2 {
        scene.seed = step;
        for (scan, mounted) in scene.scan_all(&caster)?.iter().zip(&scene.sensors) {
            println!("step {step}, {}: {} points", mounted.name, scan.len());
            scan.save(format!("{}-{step}.ply", mounted.name))?;
        }
        scene[parcel].pose.position_m.y -= 1.0;
    }
    Ok(())
}

/// A cube of side 1 around the origin.
fn cuboid() -> Result<Mesh, Error> {
    let corner = |i: u32| [i & 1, i >> 1 & 1, i >> 2].map(|side| f64::from(side) - 0.5);
    let sides =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    Mesh::from_triangles((0..8).map(corner).collect(), halves.collect())
}
