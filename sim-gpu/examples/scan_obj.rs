//! Scans an OBJ file with a VLP-32C from 3 m away and writes `scan.npz`:
//! `cargo run --release --example scan_obj -- chair.obj`

use sim_gpu::{Caster, Error, Mesh, Pose, Scene, Sensor};

fn main() -> Result<(), Error> {
    let path = std::env::args().nth(1).unwrap_or("chair.obj".to_owned());
    let mut scene = Scene::new();
    scene.add(Mesh::read(path)?.unit_sphere(), Pose::IDENTITY);
    let sensor = Sensor::named("vlp32c")?;
    let pose = Pose::looking_at_origin_deg(3.0, 20.0, 0.0);
    let scan = scene.scan(&sensor, pose).with(&Caster::auto()).run()?;
    println!("{} points", scan.len());
    scan.save("scan.npz")
}
