//! What is not asked for is not paid for: what each thing that a scene may ask
//! for adds to the shader, to the bytes that travel per ray and to the bytes of
//! a point on disk, against a table.
//!
//! `UPDATE_GOLDEN=1 cargo test -p tests --test suite only_what_is_asked` rewrites
//! `golden/only_what_is_asked.toml` after a change that is meant. What else
//! than its own a thing may change stands here, in [`Asked::own`], and is not
//! rewritten.

#[path = "only_what_is_asked/files.rs"]
mod files;
#[path = "only_what_is_asked/shader.rs"]
mod shader;
#[path = "only_what_is_asked/travel.rs"]
mod travel;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use formats::scan::{Attribute, AttributeSet};
use sim_gpu::effects::{
    Detection, Dropout, Effects, EvenMotion, Footprint, Intensity, Noise, NoiseModel, Quantum,
    ReturnMode, Weather,
};
use sim_gpu::internals::sensor::DetectionLimit;

/// What a scan costs, by what it costs: instructions, bindings, bytes.
type Rows = BTreeMap<String, u64>;

/// A table for each thing asked for: all rows for the plain scene, for all
/// others those rows that differ from it.
type Table = BTreeMap<String, Rows>;

const PLAIN: &str = "plain";

/// One thing that a scene may ask for.
struct Asked {
    name: &'static str,
    without: Effects,
    effects: Effects,
    attributes: AttributeSet,
    /// Beginnings of the rows that it may change.
    own: Vec<&'static str>,
}

/// The rows that every effect with a module of its own changes: the function
/// that calls modules, what they answer, the constants that they are set by.
const MODULE: &[&str] = &[
    "shader, function finish",
    "shader, group 1 binding 0: effect_outputs",
    "shader, bind groups",
    "ray, bytes of effect outputs read back",
    "shader, total ",
];

/// And those of every effect that draws random numbers.
const RANDOM: &[&str] = &[
    "shader, group 1 binding 1: streams",
    "shader, function random_bits",
    "shader, function philox",
    "shader, function multiply_high",
    "ray, bytes of streams sent",
];

/// And those of every noise.
const NOISE: &[&str] = &["shader, function normal_deviate", "shader, constant noise_"];

fn asked() -> Vec<Asked> {
    let plain = Effects::default;
    let limit = Some(DetectionLimit { reflectivity: 0.8, range_m: 200.0 });
    let (threshold_to_noise, range_sigma_m) = (Some(100.0), Some(0.05));
    let detection = Some(Detection { limit, threshold_to_noise, range_sigma_m });
    let noise = |model| Some(Noise { mean_m: 0.0, sigma_m: 0.01, model });
    let dropout = Some(Dropout { probability: 0.1 });
    let quantum = Some(Quantum { step_m: Some(0.004) });
    let footprint = Footprint { samples: 19, divergence_deg: None, separation_m: None };
    let footprint = (Some(footprint), Some(ReturnMode::Dual));
    let air = Weather {
        rain_mm_h: Some(25.0),
        fog_visibility_m: Some(500.0),
        empty_beams: Some(false),
        ..Weather::default()
    };
    let weather = Some(Box::new(air));
    let motion = EvenMotion { velocity_m_s: [10.0, 0.0, 0.0], yaw_rate_deg_s: 5.0 };
    let motion = Some(Box::new(motion));
    let effects: [(_, _, &[&[&str]]); 9] = [
        (
            "noise along the ray",
            Effects { noise: noise(NoiseModel::Range), ..plain() },
            &[MODULE, RANDOM, NOISE, &["shader, function noise_range"]],
        ),
        (
            "noise of each coordinate",
            Effects { noise: noise(NoiseModel::Xyz), ..plain() },
            &[MODULE, RANDOM, NOISE, &["shader, function noise_xyz"]],
        ),
        (
            "dropout",
            Effects { dropout, ..plain() },
            &[MODULE, RANDOM, &["shader, function dropout", "shader, constant dropout_"]],
        ),
        ("quantum", Effects { quantum, ..plain() }, &[]),
        ("detection limit", Effects { detection, ..plain() }, &[]),
        (
            "wide beams, dual returns",
            Effects { footprint: footprint.0, returns: footprint.1, ..plain() },
            &[],
        ),
        ("weather", Effects { weather, ..plain() }, &[]),
        ("motion", Effects { motion, ..plain() }, &[]),
        ("intensity effect", with_intensity(), &[MODULE, &["shader, function intensity"]]),
    ];
    let asked = effects.into_iter().map(|(name, effects, own)| {
        let attributes = AttributeSet::new();
        Asked { name, without: plain(), effects, attributes, own: own.concat() }
    });
    // Intensity is there only where its effect is: what its column adds to the
    // effect's rows is the file's alone.
    let stored = Attribute::ALL.into_iter().map(|attribute| {
        let needed = if attribute == Attribute::Intensity { with_intensity() } else { plain() };
        Asked {
            name: attribute.name(),
            without: needed.clone(),
            effects: needed,
            attributes: [attribute].into(),
            own: vec!["point, "],
        }
    });
    asked.chain(stored).collect()
}

fn with_intensity() -> Effects {
    Effects { intensity: Some(Intensity), ..Effects::default() }
}

fn rows(effects: &Effects, attributes: &AttributeSet) -> Rows {
    let mut rows = shader::rows(effects);
    rows.extend(travel::rows(effects));
    rows.extend(files::rows(effects, attributes));
    rows
}

/// The rows of `other` that `plain` lacks or has otherwise; 0 for one that `other` lacks.
fn difference(plain: &Rows, other: &Rows) -> Rows {
    let mut differ: Rows = other
        .iter()
        .filter(|(row, n)| plain.get(*row) != Some(n))
        .map(|(r, &n)| (r.clone(), n))
        .collect();
    differ.extend(plain.keys().filter(|row| !other.contains_key(*row)).map(|row| (row.clone(), 0)));
    differ
}

static MEASURED: LazyLock<Table> = LazyLock::new(|| {
    let none = AttributeSet::new();
    let cost = |asked: Asked| {
        let without = rows(&asked.without, &none);
        let differ = difference(&without, &rows(&asked.effects, &asked.attributes));
        (asked.name.to_owned(), differ)
    };
    let mut table: Table = asked().into_iter().map(cost).collect();
    table.insert(PLAIN.to_owned(), rows(&Effects::default(), &none));
    table
});

fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/only_what_is_asked.toml")
}

#[test]
fn costs_are_those_of_the_table() {
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        let heading = "# What a scan costs and what each thing asked for adds to it. Written by \
                       `UPDATE_GOLDEN=1 cargo test -p tests --test suite only_what_is_asked`.\n\n";
        fs::write(golden(), heading.to_owned() + &toml::to_string(&*MEASURED).unwrap()).unwrap();
    }
    let expected: Table = toml::from_str(&fs::read_to_string(golden()).unwrap()).unwrap();
    for (name, rows) in &expected {
        assert_eq!(MEASURED.get(name), Some(rows), "{name}; if that is meant, UPDATE_GOLDEN=1");
    }
    assert_eq!(MEASURED.len(), expected.len(), "the table holds all that can be asked for");
}

#[test]
fn each_thing_asked_for_changes_its_own_rows_only_and_adds_to_them() {
    let plain = &MEASURED[PLAIN];
    for Asked { name, own, .. } in asked() {
        for (row, cost) in &MEASURED[name] {
            assert!(own.iter().any(|own| row.starts_with(own)), "{name} changes {row:?}");
            let least = plain.get(row).unwrap_or(&0);
            assert!(cost > least, "{name}: {row:?} costs {cost}, of a plain scene {least}");
        }
    }
    assert_eq!(plain["shader, bind groups"], 1);
    assert_eq!(plain["ray, bytes of effect outputs read back"], 0);
    assert_eq!(plain["ray, bytes of codes read back"], 4);
    assert_eq!(plain["point, bytes in npz"], 12);
    assert_eq!(plain["point, bytes in ply"], 12);
}
