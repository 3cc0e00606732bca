//! `cargo xtask bench scenes`: what a scene of many objects costs, beside its rays alone.

use crate::measure::clock::{Spread, Workload, interleave, measured, workload};
use crate::table::{Table, milliseconds};
use anyhow::{Context, Result};
use clap::Args;
use edgepuck_scenes::{DrawnScene, Recipe, Stage};
use edgepuck_segment::{Segmenter, Settings, Sweep};
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::target::{Surface, Target};
use sim_gpu::{Mesh, Pose};
use std::path::PathBuf;

#[derive(Args, Debug)]
pub struct ScenesArgs {
    /// Scene recipe.
    #[arg(default_value = "assets/scenes/street.toml", value_name = "RECIPE")]
    recipe: PathBuf,
    /// Sensor in place of the recipe's.
    #[arg(long, default_value = "vlp32c", value_name = "NAME")]
    sensor: String,
    /// Scenes to measure.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..))]
    scenes: u32,
    /// Number of repeats of each measurement; the median counts.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    rounds: u16,
}

struct Measured {
    n_objects: usize,
    n_triangles: usize,
    n_points: usize,
    /// Ground and objects, each with its own hierarchy.
    sweep_s: f64,
    one_mesh_s: f64,
    /// To check that mesh and build its hierarchy.
    build_s: f64,
    segment_s: f64,
}

pub fn run(args: &ScenesArgs) -> Result<()> {
    let mut recipe = Recipe::load(&args.recipe)?;
    recipe.use_sensors(std::slice::from_ref(&args.sensor));
    let stage = Stage::new(recipe, &args.recipe, None, 0)?;
    let scenes = (0..args.scenes).map(|number| measure(&stage, number, args.rounds.into()));
    let scenes = scenes.collect::<Result<Vec<_>>>()?;
    print!("{}", table(&scenes));
    Ok(())
}

fn measure(stage: &Stage, number: u32, rounds: usize) -> Result<Measured> {
    let scene = DrawnScene::draw(stage, number);
    let mesh = stage.mesh(&scene);
    let n_triangles = mesh.triangles.len();
    let (whole, build) = measured(|| Target::new(Surface::of_mesh(mesh), Builder::Sah));
    let mut one_mesh = sim_gpu::Scene::new();
    one_mesh.add(Mesh::from_target(whole, glam::DVec3::ZERO), Pose::IDENTITY);
    let sweep = stage.sweep(&scene)?;
    let as_sweep = Sweep { points: sweep.points(), rings: Some(sweep.rings()) };
    let mut segmenter = Segmenter::new(Settings::default()).context("the default settings")?;
    let workloads: &mut [Workload<'_>] = &mut [
        workload(|| Ok(stage.sweep(&scene)?)),
        workload(|| Ok(stage.sweep_in(&one_mesh, &scene)?)),
        workload(|| Ok(segmenter.segment(&as_sweep)?.clusters().len())),
    ];
    let costs = interleave(rounds, workloads)?;
    let [sweep_s, one_mesh_s, segment_s] = [0, 1, 2].map(|i| costs[i].cpu_s().median);
    Ok(Measured {
        n_objects: scene.objects.len(),
        n_triangles,
        n_points: sweep.points().len(),
        sweep_s,
        one_mesh_s,
        build_s: build.cpu_s,
        segment_s,
    })
}

fn table(scenes: &[Measured]) -> Table {
    let mut table = Table::new(
        "CPU time of a scene, medians and extremes over scenes",
        &["what", "median", "least", "most"],
    );
    let mut push = |what: &str, show: fn(f64) -> String, of: &dyn Fn(&Measured) -> f64| {
        let Spread { median, min, max } = Spread::of(scenes.iter().map(of));
        table.push(vec![what.to_owned(), show(median), show(min), show(max)]);
    };
    let count = |x: f64| format!("{x:.0}");
    push("objects", count, &|one| one.n_objects as f64);
    push("triangles", count, &|one| one.n_triangles as f64);
    push("points", count, &|one| one.n_points as f64);
    push("sweep, ms", milliseconds, &|one| one.sweep_s);
    push("the same rays at one mesh, ms", milliseconds, &|one| one.one_mesh_s);
    push("sweep / one mesh", |x| format!("{x:.2}"), &|one| one.sweep_s / one.one_mesh_s);
    push("checking that mesh and building its BVH, ms", milliseconds, &|one| one.build_s);
    push("ground and clusters, ms", milliseconds, &|one| one.segment_s);
    table
}
