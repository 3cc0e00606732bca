//! Writes what the native caster finds on the meshes of the tests and on what is built in, and scans of them in
//! rain and fog, for web/test/browser.mjs to compare a browser with: `traced FOLDER`.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use edgepuck_shapes::write_off;
use edgepuck_web::Simulator;
use harness::meshes::{cube, icosphere, soup, torus};

/// Settings of scans: from outside, from near, from inside, from far.
const PLACES: [(f64, f64, f64); 4] =
    [(5.0, 6.0, 0.0), (1.75, 44.0, 42.0), (0.23, 12.0, -63.0), (30.0, 3.0, 200.0)];

/// Places among the leaves of the tree, where some beams pass borders by less than the rounding of f32.
const AMONG_LEAVES: [(f64, f64, f64); 4] =
    [(0.1, 5.0, 5.0), (0.3, 0.0, 90.0), (0.5, 10.0, 100.0), (0.5, 10.0, 280.0)];

fn main() -> anyhow::Result<()> {
    let folder = std::env::args().nth(1).context("expected a folder")?;
    let folder = Path::new(&folder);
    fs::create_dir_all(folder)?;
    let meshes = [
        ("sphere", icosphere(4)),
        ("cube", cube()),
        ("torus", torus(71)),
        ("soup", soup(2000, 0.2)),
        ("crossing", soup(20, 1.0)),
    ];
    for (name, mesh) in meshes {
        write_off(&mesh, &folder.join(format!("{name}.off")))?;
    }
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    for entry in
        fs::read_dir(assets.join("meshes"))?.flat_map(|class| fs::read_dir(class?.path())).flatten()
    {
        let file = entry?;
        fs::copy(file.path(), folder.join(file.file_name()))?;
    }
    let mut cases = Vec::new();
    let mut files =
        fs::read_dir(folder)?.map(|file| Ok(file?.path())).collect::<anyhow::Result<Vec<_>>>()?;
    files.retain(|file| {
        file.extension().is_some_and(|extension| extension == "off" || extension == "obj")
    });
    files.sort();
    let mut simulator =
        pollster::block_on(Simulator::open("cpu")).map_err(|cause| anyhow!(cause))?;
    let built_in = ["car", "person", "tree", "street"].map(PathBuf::from);
    for file in files.into_iter().chain(built_in) {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let taken = match file.extension() {
            Some(_) => simulator.take_file(&name, &fs::read(&file)?).map(drop),
            None => simulator.take_built_in(&name),
        };
        taken.map_err(|cause| anyhow!(cause))?;
        let places = match name.as_str() {
            "tree" => [PLACES, AMONG_LEAVES].concat(),
            // Its sensor has a place of its own.
            "street" => PLACES[..1].to_vec(),
            _ => PLACES.to_vec(),
        };
        // Weather needs a detection limit, which the second sensor lacks.
        for (sensor, rain_mm_h, fog_m) in [("vlp32c", 20.0, 80.0), ("generic-static", 0.0, 0.0)] {
            for &(distance_m, elevation_deg, azimuth_deg) in &places {
                let returns = (rain_mm_h > 0.0 && distance_m == 5.0).then_some("dual");
                let settings = serde_json::json!({
                    "sensor": sensor, "distance_m": distance_m, "elevation_deg": elevation_deg,
                    "azimuth_deg": azimuth_deg, "noise_m": 0.02, "rain_mm_h": rain_mm_h, "fog_m": fog_m,
                    "returns": returns,
                });
                let traced = pollster::block_on(simulator.trace(&settings.to_string()));
                let traced = traced.map_err(|cause| anyhow!(cause))?;
                let scan = pollster::block_on(simulator.scan(&settings.to_string()));
                let scan = scan.map_err(|cause| anyhow!(cause))?;
                let case = cases.len().to_string();
                let write =
                    |ending, bytes| fs::write(folder.join(format!("{case}.{ending}")), bytes);
                write("codes", le(&traced.codes, |code| code.to_le_bytes()))?;
                write("triangles", le(&traced.triangles, |triangle| triangle.to_le_bytes()))?;
                write("ranges", le(&traced.ranges, |range| range.to_le_bytes()))?;
                let columns = [scan.positions, scan.range, scan.intensity].concat();
                write("scan", le(&columns, |number| number.to_le_bytes()))?;
                cases.push(serde_json::json!({
                    "case": case, "subject": name, "is_file": file.extension().is_some(),
                    "settings": settings,
                }));
            }
        }
    }
    fs::write(folder.join("cases.json"), serde_json::to_string(&cases)?)?;
    Ok(())
}

fn le<T: Copy, const N: usize>(numbers: &[T], bytes: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    numbers.iter().flat_map(|&number| bytes(number)).collect()
}
