//! Scans a mesh from 36 sides on the best adapter there is, with 2 cm of noise
//! and ranges and intensities beside the points:
//! `cargo run --release --example scan_on_gpu -- chair.obj`

use std::error::Error;
use std::path::Path;

use sim_gpu::effects::{Effects, Intensity, Noise, NoiseModel};
use sim_gpu::formats::rng::StreamKey;
use sim_gpu::formats::scan::Attribute;
use sim_gpu::glam::DVec3;
use sim_gpu::internals::caster::{AdapterRequest, Caster};
use sim_gpu::internals::mesh::frame::Normalize;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{ScanRequest, scan_many};
use sim_gpu::internals::sensor::Sensor;
use sim_gpu::internals::target::Target;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: scan_on_gpu MESH")?;
    let target = Target::load(Path::new(&path), Normalize::UnitSphere)?;
    let sensor = Sensor::resolve("vlp32c")?;
    let pattern = sensor.pattern();
    let noise = Noise { mean_m: 0.0, sigma_m: 0.02, model: NoiseModel::Range };
    let effects = Effects { noise: Some(noise), intensity: Some(Intensity), ..Effects::default() };
    let caster = Caster::open(&AdapterRequest::Auto, &effects)?;

    let request = |side: u32| {
        let azimuth_rad = f64::from(side) * 10f64.to_radians();
        let pose = Pose::view(3.0, 20f64.to_radians(), azimuth_rad, DVec3::ZERO);
        let mut request = ScanRequest::new(&sensor, &pattern, pose);
        request.attributes = [Attribute::Range, Attribute::Intensity].into();
        request.stream = StreamKey::new(0, "my scans", side);
        (&target, request)
    };
    let requests: Vec<_> = (0..36).map(request).collect();
    for (side, scanned) in scan_many(&caster, &requests)?.iter().enumerate() {
        println!("{}, side {side}: {} points", caster.name(), scanned.tally.points);
    }
    Ok(())
}
