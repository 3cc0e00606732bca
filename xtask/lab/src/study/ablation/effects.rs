//! The effects, and for each two datasets that differ in nothing else.

use super::plan::Plan;
use crate::study::uniform_raster::as_even_grid;
use anyhow::Context;
use edgepuck_dataset::config::{DatasetConfig, SetConfig, Variant, Viewpoints};
use edgepuck_dataset::surfaces::SurfaceConfig;
use formats::hash::Hashing;
use formats::scan::Attribute;
use formats::scan_file::ScanFormat;
use formats::vlp32c::Returns;
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel, Quantum};
use sim_gpu::internals::mesh::frame::Normalize;
use sim_gpu::internals::sensor::{SensorProfile, Views};

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

/// A dataset of scans with `switches`.
pub fn scans(plan: &Plan, switches: Switches) -> anyhow::Result<DatasetConfig> {
    let sensor = SensorProfile::builtin("vlp32c").context("no built-in sensor vlp32c")?;
    let stated = sensor.noise.map(|noise| noise.typical_sigma_m);
    let sigma_m = plan
        .noise_m
        .or(stated)
        .context("noise_m: expected a value, because the sensor states none")?;
    let effects = Effects {
        noise: switches.noise.map(|model| Noise { mean_m: 0.0, sigma_m, model }),
        dropout: switches.dropout.then_some(Dropout { probability: plan.dropout }),
        quantum: switches.quantum.then_some(Quantum { step_m: None }),
        intensity: switches.intensity.then_some(Intensity),
        ..Effects::default()
    };
    let attributes = [(switches.intensity, Attribute::Intensity), (switches.time, Attribute::Time)];
    let attributes = attributes.into_iter().filter(|(is_wanted, _)| *is_wanted);
    let sensor = if switches.beams { sensor } else { as_even_grid(sensor)? };
    Ok(DatasetConfig {
        seed: SEED,
        normalize: Normalize::default(),
        up: None,
        simplify: None,
        attributes: attributes.map(|(_, attribute)| attribute).collect(),
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
        hash: Hashing::default(),
        reflectivity: 1.0,
        colours: None,
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
}
