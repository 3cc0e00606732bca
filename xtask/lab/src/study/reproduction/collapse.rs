//! Where the collapse from one dataset to another comes from: one step at a
//! time from uniform samples to noisy scans.

use super::context::ExperimentContext;
use super::page::Section;
use super::sets;
use crate::render::table::{Cell, Table};
use anyhow::ensure;
use formats::labelled::read_labelled;
use formats::rng::StreamKey;
use formats::split::Split;
use infer_cpu::{Normalization, Options};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::rc::Rc;
use train::clouds::Clouds;
use train::evaluate::confusion;

/// Test clouds of one step, and whether they are used where they lie.
struct Step {
    name: &'static str,
    clouds: Rc<Clouds>,
    unmoved: bool,
}

pub fn run(context: &ExperimentContext) -> anyhow::Result<Section> {
    let steps = steps(context)?;
    let networks = networks(context)?;
    let title = "Instance accuracy after each step, of networks by what they were trained on";
    let mut table = Table::new(title, &["tested on"]);
    table.heading.extend(networks.iter().map(|(name, _)| (*name).to_owned()));
    for step in &steps {
        let normalization = step.unmoved.then_some(Normalization::None);
        let options = Options { normalization, ..Options::default() };
        let tested = |(_, model): &(&str, PathBuf)| {
            Ok(Cell::instance(&confusion(model, &step.clouds, &options)?))
        };
        table.measure(step.name, networks.iter().map(tested))?;
    }
    let about = [
        format!(
            "Data: {}. The two turned sets are asides; from occlusion on, every step keeps \
             those before it.",
            context.meshes_are
        ),
        "Uniform samples have one cloud a mesh, all else one a view. What a view sees is \
         decided by casting a ray at each sample from where the sensor stands."
            .to_owned(),
    ];
    Ok(Section::new("Where the collapse comes from", about, vec![("3 steps", table)]))
}

/// Networks by the mix that they were trained on.
fn networks(context: &ExperimentContext) -> anyhow::Result<Vec<(&'static str, PathBuf)>> {
    let train = |place: &str| context.scans(place, Split::Train);
    let (surface, seen) = (train("surfaces/surface")?, train("surfaces/seen")?);
    let noisy = train("lidar/packed/rotational-noisy")?;
    let mixed = |name: &str, other: &Clouds| {
        let joined = surface.concat(other);
        let clouds = joined
            .map_err(|cause| anyhow::anyhow!("surfaces and scans cannot be joined: {cause}"))?;
        context.network(name, sets::recipe(context, clouds.len()), &clouds)
    };
    let turned = {
        let mut recipe = sets::recipe(context, surface.len());
        recipe.augment.rotate_degrees = 180.0;
        context.network("on-surface-turned", recipe, &surface)?
    };
    Ok(vec![
        ("uniform samples", sets::network(context, "surfaces/surface")?),
        ("the same, turned about z in training", turned),
        ("what each view sees of them", sets::network(context, "surfaces/seen")?),
        ("uniform and seen", mixed("on-surface-and-seen", &seen)?),
        ("rotational noisy", sets::network(context, "lidar/packed/rotational-noisy")?),
        ("uniform and rotational noisy", mixed("on-surface-and-noisy", &noisy)?),
    ])
}

fn steps(context: &ExperimentContext) -> anyhow::Result<Vec<Step>> {
    let test = |place: &str| context.scans(place, Split::Test);
    let surface = test("surfaces/surface")?;
    let seen = Clouds::read_unmoved(&context.scans.join("surfaces/seen"), Split::Test)?;
    let mut normalized = seen.clone();
    normalized.normalize();
    let thinned = thinned(context, &seen)?;
    let step = |name, clouds| Step { name, clouds, unmoved: false };
    Ok(vec![
        step("uniform samples of the surface", Rc::clone(&surface)),
        step("aside: the same, turned about z at random", Rc::new(turned(&surface, false))),
        step("aside: the same, y up and turned at random", Rc::new(turned(&surface, true))),
        Step {
            name: "occlusion: what a view sees, where it lies",
            clouds: Rc::new(seen),
            unmoved: true,
        },
        step("and normalised by what is seen", Rc::new(normalized)),
        step("and as few points as the scan has", Rc::new(thinned)),
        step("and the beam pattern: rotational clean", test("lidar/packed/rotational-clean")?),
        step("and noise: rotational noisy", test("lidar/packed/rotational-noisy")?),
    ])
}

/// Each cloud turned about z by an angle of its own; `y_up` then puts z along y
/// as the baseline's text files have it.
fn turned(clouds: &Clouds, y_up: bool) -> Clouds {
    let mut clouds = clouds.clone();
    for i in 0..clouds.len() {
        let angle = std::f64::consts::TAU * StreamKey::new(0, "turned", i as u32).unit(0);
        let (sin, cos) = (angle.sin() as f32, angle.cos() as f32);
        for [x, y, z] in clouds.set.cloud_mut(i) {
            (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
            if y_up {
                (*y, *z) = (*z, -*y);
            }
        }
    }
    clouds
}

/// The clouds of `seen` with as many distinct points as the scan of the same view; the others are
/// repetitions. Views that have no scan are left out.
fn thinned(context: &ExperimentContext, seen: &Clouds) -> anyhow::Result<Clouds> {
    let scans = read_labelled(&context.scans.join("lidar/packed/rotational-clean-test.npz"))?;
    let names = scans.names.iter().flatten().map(String::as_str);
    let counts: BTreeMap<&str, u32> = names.zip(scans.n_raw.iter().flatten().copied()).collect();
    let names = seen.set.names.iter().flatten();
    let kept: Vec<(usize, usize)> = names
        .enumerate()
        .filter_map(|(i, name)| Some((i, *counts.get(name.as_str())? as usize)))
        .collect();
    ensure!(!kept.is_empty(), "no cloud of seen-test.npz has a scan of its name");
    let mut clouds = seen.select(&kept.iter().map(|(i, _)| *i).collect::<Vec<_>>());
    for (cloud, (_, count)) in kept.into_iter().enumerate() {
        let points = clouds.set.cloud_mut(cloud);
        let n = count.clamp(1, points.len());
        for i in n..points.len() {
            points[i] = points[i % n];
        }
    }
    clouds.normalize();
    Ok(clouds)
}
