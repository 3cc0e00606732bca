//! The effects, and for each two datasets that differ in nothing else.

use super::plan::Plan;
use anyhow::Context;
use formats::scan::Attribute;
use formats::scan_file::ScanFormat;
use formats::vlp32c::Returns;
use sim_gpu::dataset::config::{DatasetConfig, SetConfig, Variant, Viewpoints};
use sim_gpu::dataset::surfaces::SurfaceConfig;
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel, Quantum};
use sim_gpu::mesh::frame::Normalize;
use sim_gpu::sensor::{Layout, Rotating, Sensor, Uniform, Views};

/// What is switched on and off.
pub struct Effect {
    /// Its name in the table.
    pub name: &'static str,
    /// The dataset that has it.
    pub with: &'static str,
    /// The one that has not.
    pub without: &'static str,
    /// How its worth is found.
    pub judged_by: Judge,
}

/// How an effect's worth is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judge {
    /// Networks are trained with and without it, and tested with and without.
    Networks,
    /// It cannot reach a network that sees positions: all positions are
    /// compared, bit by bit.
    Positions,
}

/// The scans that have all that a real sensor does.
pub const REFERENCE: &str = "reference";

/// All effects.
pub const EFFECTS: [Effect; 9] = [
    trained("noise", REFERENCE, "no-noise"),
    trained("noise-model", REFERENCE, "xyz-noise"),
    trained("dropout", REFERENCE, "no-dropout"),
    trained("quantum", REFERENCE, "no-quantum"),
    trained("beams", REFERENCE, "grid"),
    trained("all-of-these", REFERENCE, "plain"),
    trained("occlusion", "seen", "surface"),
    compared("intensity", REFERENCE, "no-intensity"),
    compared("time", REFERENCE, "no-time"),
];

const fn trained(name: &'static str, with: &'static str, without: &'static str) -> Effect {
    Effect { name, with, without, judged_by: Judge::Networks }
}

const fn compared(name: &'static str, with: &'static str, without: &'static str) -> Effect {
    Effect { name, with, without, judged_by: Judge::Positions }
}

/// What a dataset is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Scans, with these effects.
    Scans(Switches),
    /// Points spread over whole meshes.
    Surface,
    /// Those of them that lie open to the sensor.
    Seen,
}

/// The effects of scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switches {
    /// The sensor's own table of beams, and not a regular grid.
    pub beams: bool,
    pub noise: Option<NoiseModel>,
    pub dropout: bool,
    pub quantum: bool,
    pub intensity: bool,
    pub time: bool,
}

const REAL: Switches = Switches {
    beams: true,
    noise: Some(NoiseModel::Range),
    dropout: true,
    quantum: true,
    intensity: true,
    time: true,
};

const PLAIN: Switches =
    Switches { beams: false, noise: None, dropout: false, quantum: false, ..REAL };

/// All datasets by name.
pub const DATASETS: [(&str, Source); 11] = [
    (REFERENCE, Source::Scans(REAL)),
    ("no-noise", Source::Scans(Switches { noise: None, ..REAL })),
    ("xyz-noise", Source::Scans(Switches { noise: Some(NoiseModel::Xyz), ..REAL })),
    ("no-dropout", Source::Scans(Switches { dropout: false, ..REAL })),
    ("no-quantum", Source::Scans(Switches { quantum: false, ..REAL })),
    ("grid", Source::Scans(Switches { beams: false, ..REAL })),
    ("plain", Source::Scans(PLAIN)),
    ("no-intensity", Source::Scans(Switches { intensity: false, ..REAL })),
    ("no-time", Source::Scans(Switches { time: false, ..REAL })),
    ("surface", Source::Surface),
    ("seen", Source::Seen),
];

/// The name of the scans' one set.
const SET: &str = "rotational";

/// Key of all random numbers of the datasets.
const SEED: u64 = 0;

/// The sensor of all scans.
fn sensor() -> anyhow::Result<Sensor> {
    Sensor::builtin("vlp32c").context("no built-in sensor vlp32c")
}

/// A dataset of scans with `switches`.
///
/// # Errors
/// A sensor that states no noise where the plan has none.
pub fn scans(plan: &Plan, switches: Switches) -> anyhow::Result<DatasetConfig> {
    let sensor = sensor()?;
    let stated = sensor.noise.map(|noise| noise.typical_sigma_m);
    let sigma_m = plan.noise_m.or(stated).context("no noise: state noise_m")?;
    let effects = Effects {
        noise: switches.noise.map(|model| Noise { mean_m: 0.0, sigma_m, model }),
        dropout: switches.dropout.then_some(Dropout { probability: plan.dropout }),
        quantum: switches.quantum.then_some(Quantum { step_m: None }),
        intensity: switches.intensity.then_some(Intensity),
    };
    let kept = |wanted: bool, attribute| wanted.then_some(attribute);
    let sensor = if switches.beams { sensor } else { as_grid(sensor)? };
    Ok(DatasetConfig {
        seed: SEED,
        normalize: Normalize::default(),
        up: None,
        simplify: None,
        attributes: [
            kept(switches.intensity, Attribute::Intensity),
            kept(switches.time, Attribute::Time),
        ]
        .into_iter()
        .flatten()
        .collect(),
        formats: vec![ScanFormat::Npz],
        effects,
        // Of all datasets, so that points are drawn by one key.
        variants: vec![Variant::Noisy],
        sets: vec![SetConfig {
            name: SET.to_owned(),
            sensor,
            viewpoints: Viewpoints::Views(views(plan)),
        }],
        packed_points: plan.packed_points,
        min_points: plan.min_points,
        layouts: Vec::new(),
        returns: Returns::default(),
    })
}

/// Where the packed clouds of scans lie, from their dataset's folder.
pub fn packed() -> String {
    format!("packed/{SET}-{}", Variant::Noisy.name())
}

/// Points of surfaces, looked at from where the scans are taken, or from
/// nowhere.
pub fn surfaces(plan: &Plan, source: Source) -> SurfaceConfig {
    let count = if source == Source::Seen { plan.views } else { 0 };
    SurfaceConfig {
        seed: SEED,
        normalize: Normalize::default(),
        up: None,
        points: plan.packed_points,
        min_points: plan.min_points,
        views: Views { count, ..views(plan) },
    }
}

fn views(plan: &Plan) -> Views {
    Views { count: plan.views, ..Views::ROTATING }
}

/// The same sensor with as many rows and columns, evenly spread between its
/// lowest and its highest beam and all around.
fn as_grid(sensor: Sensor) -> anyhow::Result<Sensor> {
    let Layout::Rotating(table) = &sensor.layout else {
        anyhow::bail!("{}: has no table of beams", sensor.name);
    };
    let name = format!("{}-grid", sensor.name);
    let layout = Layout::Uniform(grid(table));
    Ok(Sensor { name, layout, ..sensor })
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
    fn the_two_datasets_of_an_effect_differ_in_nothing_else() {
        let source = |name: &str| DATASETS.iter().find(|(known, _)| *known == name).unwrap().1;
        for effect in &EFFECTS {
            let (with, without) = (source(effect.with), source(effect.without));
            let (Source::Scans(with), Source::Scans(without)) = (with, without) else {
                assert_eq!(
                    (effect.name, with, without),
                    ("occlusion", Source::Seen, Source::Surface)
                );
                continue;
            };
            let differ = [
                with.beams != without.beams,
                with.noise != without.noise,
                with.dropout != without.dropout,
                with.quantum != without.quantum,
                with.intensity != without.intensity,
                with.time != without.time,
            ];
            let n = differ.iter().filter(|differ| **differ).count();
            assert_eq!(n, if effect.name == "all-of-these" { 4 } else { 1 }, "{}", effect.name);
        }
    }

    #[test]
    fn the_grid_spans_what_the_beams_do_with_as_many_rays() {
        let sensor = sensor().unwrap();
        let Layout::Rotating(table) = &sensor.layout else { panic!("no table") };
        let rays = table.rays_per_revolution();
        let Layout::Uniform(grid) = as_grid(sensor.clone()).unwrap().layout else {
            panic!("no grid")
        };
        assert_eq!((grid.elevation_from_deg, grid.elevation_to_deg), (-25.0, 15.0));
        // The last firing sequence of a revolution is cut short.
        let of_grid = u64::from(grid.azimuth_steps) * u64::from(grid.elevation_steps);
        assert!(rays - of_grid < u64::from(grid.elevation_steps), "{rays}, {of_grid}");
    }
}
