//! Scans an OBJ file with a VLP-32C from 3 m away and writes `scan.npz`:
//! `cargo run --example scan_obj -- chair.obj`

use std::error::Error;
use std::path::Path;

use sim_gpu::effects::Effects;
use sim_gpu::formats::hash::Hashing;
use sim_gpu::formats::scan_file::{ScanFormat, write_scan};
use sim_gpu::glam::DVec3;
use sim_gpu::internals::caster::Caster;
use sim_gpu::internals::mesh::frame::Normalize;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::ScanRequest;
use sim_gpu::internals::sensor::Sensor;
use sim_gpu::internals::target::Target;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: scan_obj MESH.obj")?;
    let target = Target::load(Path::new(&path), Normalize::UnitSphere)?;
    let sensor = Sensor::resolve("vlp32c")?;
    let pattern = sensor.pattern();
    let pose = Pose::look_at(DVec3::new(3.0, 0.0, 1.0), DVec3::ZERO)?;
    let caster = Caster::Cpu(Effects::default());
    let scan = sim_gpu::internals::scan::scan(
        &caster,
        &target,
        &ScanRequest::new(&sensor, &pattern, pose),
    )?;
    write_scan(Path::new("scan.npz"), ScanFormat::Npz, Hashing::None, &scan)?;
    Ok(())
}
