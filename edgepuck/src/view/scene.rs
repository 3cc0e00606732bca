//! Meshes, and scenes with what their sensors see.

use super::frame::{Frame, Labels, Mesh, Points, Sensor, from_origin};
use formats::scan::{Attribute, AttributeSet};
use glam::DVec3;
use sim_gpu::{Caster, Import, Instance, Pose, Scan, Scene, glam};
use std::path::Path;

/// The most beams of a sensor that are drawn.
const MOST_RAYS: usize = 1500;

/// A mesh, as a scene of one instance.
pub fn of_mesh(file: &Path) -> anyhow::Result<Frame> {
    let mut scene = Scene::new();
    let id = scene.add(sim_gpu::Mesh::read(file)?, Pose::IDENTITY);
    scene[id].name = file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    of_scene(&scene)
}

/// What stands in a glTF file, a robot's file or a scene's.
pub fn read(file: &Path) -> anyhow::Result<Frame> {
    match edgepuck_mesh::import::Format::from_path(file) {
        None => of_scene(&Scene::read(file)?),
        Some(_) => {
            let mut scene = Scene::new();
            scene.add_file(file, &Import::default())?;
            of_scene(&scene)
        }
    }
}

fn of_scene(scene: &Scene) -> anyhow::Result<Frame> {
    scene.warnings().iter().for_each(|warning| program::say!("warning: {warning}"));
    let mut scene = scene.clone();
    let wanted = [Attribute::Range, Attribute::Ring, Attribute::Object, Attribute::Intensity];
    scene.attributes = AttributeSet::from(wanted);
    let caster = Caster::cpu();
    let scan = |number| scene.scan_mounted(number).with(&caster).run();
    let scans = (0..scene.sensors.len()).map(scan).collect::<Result<Vec<_>, _>>()?;
    if !scans.is_empty() && scans.iter().all(|scan| scan.is_empty()) {
        program::say!("warning: no beam of a sensor returned a point");
    }
    let origin = scans.first().map_or_else(|| origin_of(&scene), |scan| scan.origin);
    let meshes = scene.instances().iter().map(|instance| mesh(instance, origin)).collect();
    let sensors = scene.sensors.iter().zip(&scans).map(|(mounted, scan)| {
        let pose = scan.pose.unwrap_or(mounted.pose.matrix());
        let pose = from_origin(pose, origin);
        let start = [pose[3], pose[7], pose[11]].map(|x| x as f32);
        let ends = scan.positions.iter().step_by(scan.len().div_ceil(MOST_RAYS).max(1));
        let rays = ends.flat_map(|end| [start, *end]).collect();
        Sensor { name: mounted.name.clone(), pose, rays }
    });
    let sensors = sensors.collect();
    let points = (!scans.is_empty()).then(|| joined(&scene, &scans, origin));
    Ok(Frame { origin, points, meshes, sensors, ..Frame::default() })
}

/// A point near the meshes if they are so far from the origin that f32 would lose their shape.
fn origin_of(scene: &Scene) -> [f64; 3] {
    const FAR_M: f64 = 1e4;
    let Some(first) = scene.instances().first() else { return [0.0; 3] };
    let [low, _] = first.mesh.bounds_m();
    let at = (DVec3::from(low) + first.pose.position_m).round();
    if at.abs().max_element() < FAR_M { [0.0; 3] } else { at.to_array() }
}

/// The points of all sensors.
fn joined(scene: &Scene, scans: &[Scan], origin: [f64; 3]) -> Points {
    let names = scene.sensors.iter().map(|mounted| mounted.name.clone()).collect();
    let mut sensor = Labels { name: "sensor", values: Vec::new(), names: Some(names) };
    let pose = scans.first().and_then(|scan| scan.pose);
    let object_texts = scene.object_texts();
    let mut all = formats::Scan { origin, pose, object_texts, ..formats::Scan::default() };
    for (scan, number) in scans.iter().zip(0..) {
        let shift = [0, 1, 2].map(|axis| (scan.origin[axis] - origin[axis]) as f32);
        let place = |at: &[f32; 3]| [0, 1, 2].map(|axis| at[axis] + shift[axis]);
        all.positions.extend(scan.positions.iter().map(place));
        append(&mut all.range_m, &scan.range_m);
        append(&mut all.ring, &scan.ring);
        append(&mut all.object, &scan.object);
        append(&mut all.intensity, &scan.intensity);
        sensor.values.resize(all.positions.len(), number);
    }
    let labels = if scans.len() > 1 { vec![sensor] } else { Vec::new() };
    Points { scan: all, labels }
}

fn append<T: Copy>(all: &mut Option<Vec<T>>, values: &Option<Vec<T>>) {
    all.get_or_insert_default().extend(values.iter().flatten());
}

/// An instance where it stands; if it moves, at time 0.
fn mesh(instance: &Instance, origin: [f64; 3]) -> Mesh {
    let at = instance.motion.as_ref().map_or(Pose::IDENTITY, |motion| motion.at(0.0));
    let place = |vertex: &DVec3| {
        let own = instance.pose.rotation * (instance.scale * *vertex) + instance.pose.position_m;
        (at.rotation * own + at.position_m - DVec3::from(origin)).as_vec3().to_array()
    };
    Mesh {
        name: instance.name.clone().unwrap_or_default(),
        class: instance.label.clone(),
        position: instance.mesh.vertices().iter().map(place).collect(),
        index: instance.mesh.triangles().to_vec(),
    }
}
