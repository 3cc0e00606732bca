//! The datasets of studies, which a killed run leaves to the next one to finish, and the even grid
//! that simulators without a table of beams cast in its place.

use super::resume;
use anyhow::{Context, bail};
use edgepuck_dataset::{
    Begin, DatasetConfig, Manifest, MeshEntry, Plan, Progress, SurfaceConfig, Viewpoints, Views,
    make, write_surfaces,
};
use edgepuck_program::gen_dataset;
use edgepuck_shapes::write_tree;
use formats::atomic;
use formats::split::Split;
use sim_gpu::Caster;
use sim_gpu::internals::sensor::{Layout, Rotating, SensorProfile, Uniform};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The folder `asked`, or `folder` with built-in shapes: `train` and `test` of each class.
pub fn meshes(
    asked: Option<&Path>,
    folder: &Path,
    [train, test]: [u32; 2],
) -> anyhow::Result<PathBuf> {
    if let Some(asked) = asked {
        return Ok(asked.to_owned());
    }
    write_tree(folder, 0, train, test).context("cannot write the shapes")?;
    Ok(folder.to_owned())
}

/// Keeps the first meshes of each class: at most `train` to train on and `test` to test with.
pub fn keep_at_most([train, test]: [u32; 2], meshes: &mut Vec<MeshEntry>) {
    let mut seen = BTreeMap::new();
    meshes.retain(|mesh| {
        let most = if mesh.split == Split::Train { train } else { test };
        let n = seen.entry((mesh.class.clone(), mesh.split)).or_insert(0);
        *n += 1;
        *n <= most
    });
}

/// The configuration of `gen-dataset` with `flags`, separated by spaces.
pub fn config(flags: &str) -> anyhow::Result<DatasetConfig> {
    let words: Vec<String> = flags.split_whitespace().map(str::to_owned).collect();
    gen_dataset::config(&words).with_context(|| format!("gen-dataset {flags}"))
}

/// Scans `meshes` by `config` into `out` on `caster`.
pub fn scans(
    config: DatasetConfig,
    caster: &Caster,
    meshes: &[MeshEntry],
    out: &Path,
) -> anyhow::Result<Manifest> {
    let plan = Plan { begin: Begin::Resume, ..Plan::new(out, &config, meshes) };
    Ok(make(&plan, caster, &Progress::default())?)
}

/// Samples the surfaces of `meshes`, whole and as the views of `config` see them, into
/// `surface-*.npz` and `seen-*.npz` in `out`; without `views`, only whole. Returns the number of
/// meshes that failed.
pub fn surfaces(
    config: &DatasetConfig,
    views: bool,
    meshes: &[MeshEntry],
    out: &Path,
) -> anyhow::Result<usize> {
    resume::result(&out.join("failures.txt"), || {
        atomic::sweep_leftovers(out)?;
        let of_set = match &config.sets[0].viewpoints {
            Viewpoints::Views(views) => views.clone(),
            Viewpoints::Poses(_) => Views::ROTATING,
        };
        let surfaces = SurfaceConfig {
            seed: config.seed,
            normalize: config.normalize,
            up: config.up,
            points: config.packed_points,
            min_points: config.min_points,
            views: Views { count: if views { of_set.count } else { 0 }, ..of_set },
        };
        Ok(write_surfaces(out, &surfaces, meshes, &Progress::default())?.len())
    })
}

/// The same sensor with as many rows and columns, evenly spread between its
/// lowest and its highest beam and all around.
pub fn as_even_grid(sensor: SensorProfile) -> anyhow::Result<SensorProfile> {
    let Layout::Rotating(table) = &sensor.layout else {
        bail!("{}: has no table of beams", sensor.name);
    };
    let name = format!("{}-grid", sensor.name);
    let layout = Layout::Uniform(grid(table));
    Ok(SensorProfile { name, layout, ..sensor })
}

fn grid(table: &Rotating) -> Uniform {
    let elevations = || table.beam.iter().map(|beam| beam.elevation_deg);
    let rows = table.beam.len() as u32;
    let columns = (table.rays_per_revolution() / u64::from(rows)).max(1) as u32;
    let step_deg = 360.0 / f64::from(columns);
    Uniform {
        azimuth_from_deg: -180.0,
        // Both ends belong to the grid: the last column is not the first again.
        azimuth_to_deg: 180.0 - step_deg,
        azimuth_steps: columns,
        elevation_from_deg: elevations().fold(f64::INFINITY, f64::min),
        elevation_to_deg: elevations().fold(f64::NEG_INFINITY, f64::max),
        elevation_steps: rows,
        rpm: Some(table.rpm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_spans_what_the_beams_do_with_as_many_rays() {
        let sensor = SensorProfile::builtin("vlp32c").unwrap();
        let Layout::Rotating(table) = &sensor.layout else { panic!("no table") };
        let rays = table.rays_per_revolution();
        let Layout::Uniform(grid) = as_even_grid(sensor.clone()).unwrap().layout else {
            panic!("no grid")
        };
        assert_eq!((grid.elevation_from_deg, grid.elevation_to_deg), (-25.0, 15.0));
        // The last firing sequence of a revolution is cut short.
        let of_grid = u64::from(grid.azimuth_steps) * u64::from(grid.elevation_steps);
        assert!(rays - of_grid < u64::from(grid.elevation_steps), "{rays}, {of_grid}");
    }
}
