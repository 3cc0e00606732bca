//! What is not asked for is not paid for: what each thing that a scene may ask
//! for adds to the shader, to the bytes that travel per ray and to the bytes of
//! a point on disk, against a table.
//!
//! `UPDATE_GOLDEN=1 cargo test -p tests --test only_what_is_asked` rewrites
//! `golden/only_what_is_asked.toml` after a change that is meant. What else
//! than its own a thing may change stands here, in [`Asked::own`], and is not
//! rewritten.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "only_what_is_asked/files.rs"]
mod files;
#[path = "only_what_is_asked/shader.rs"]
mod shader;
#[path = "only_what_is_asked/travel.rs"]
mod travel;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use formats::scan::{Attribute, AttributeSet};
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel, Quantum};

/// What a scan costs, by what it costs: instructions, bindings, bytes.
type Rows = BTreeMap<String, u64>;

/// A table for each thing asked for: all rows for the plain scene, for all
/// others those rows that differ from it.
type Table = BTreeMap<String, Rows>;

const PLAIN: &str = "plain";

/// One thing that a scene may ask for.
struct Asked {
    name: &'static str,
    effects: Effects,
    attributes: AttributeSet,
    /// Beginnings of the rows that it may change.
    own: &'static [&'static str],
}

/// The rows that every effect with a module of its own changes: the function
/// that calls modules, what they answer, the constants that they are set by.
const MODULES: [&str; 5] = [
    "shader, function finish",
    "shader, group 1 binding 0: effect_outputs",
    "shader, bind groups",
    "ray, bytes of effect outputs read back",
    "shader, total ",
];

/// And those of every effect that draws random numbers.
const RANDOM: [&str; 5] = [
    "shader, group 1 binding 1: streams",
    "shader, function random_bits",
    "shader, function philox",
    "shader, function multiply_high",
    "ray, bytes of streams sent",
];

fn asked() -> Vec<Asked> {
    let noise = |model| Noise { mean_m: 0.0, sigma_m: 0.01, model };
    let effect = |name, effects, own| Asked { name, effects, attributes: AttributeSet::new(), own };
    let mut asked = vec![
        effect(
            "noise along the ray",
            Effects { noise: Some(noise(NoiseModel::Range)), ..Effects::default() },
            &["module", "random", "shader, function noise_range", NORMAL_DEVIATE, NOISE] as &[_],
        ),
        effect(
            "noise of each coordinate",
            Effects { noise: Some(noise(NoiseModel::Xyz)), ..Effects::default() },
            &["module", "random", "shader, function noise_xyz", NORMAL_DEVIATE, NOISE],
        ),
        effect(
            "dropout",
            Effects { dropout: Some(Dropout { probability: 0.1 }), ..Effects::default() },
            &["module", "random", "shader, function dropout", "shader, constant dropout_"],
        ),
        effect(
            "quantum",
            Effects { quantum: Some(Quantum { step_m: Some(0.004) }), ..Effects::default() },
            &[],
        ),
        effect(
            "intensity effect",
            Effects { intensity: Some(Intensity), ..Effects::default() },
            &[
                "module",
                "shader, function intensity",
                "shader, group 1 binding 2: reflectivities",
                "ray, bytes of reflectivities sent",
            ],
        ),
    ];
    // Intensity is there only where its effect is: its own column is asked
    // for, and what it adds to the effect's rows is the file's alone.
    let stored = Attribute::ALL.into_iter().filter(|&a| a != Attribute::Intensity);
    asked.extend(stored.map(|attribute| Asked {
        name: attribute.name(),
        effects: Effects::default(),
        attributes: [attribute].into(),
        own: &["point, "],
    }));
    asked
}

const NORMAL_DEVIATE: &str = "shader, function normal_deviate";
const NOISE: &str = "shader, constant noise_";

impl Asked {
    fn owns(&self, row: &str) -> bool {
        self.own.iter().any(|own| match *own {
            "module" => MODULES.iter().any(|module| row.starts_with(module)),
            "random" => RANDOM.iter().any(|random| row.starts_with(random)),
            own => row.starts_with(own),
        })
    }
}

fn rows(effects: &Effects, attributes: &AttributeSet) -> Rows {
    let mut rows = shader::rows(effects);
    rows.extend(travel::rows(effects));
    rows.extend(files::rows(effects, attributes));
    rows
}

/// The rows of `other` that `plain` lacks or has otherwise; 0 for one that
/// `other` lacks.
fn difference(plain: &Rows, other: &Rows) -> Rows {
    let mut differ: Rows = other
        .iter()
        .filter(|(row, n)| plain.get(*row) != Some(n))
        .map(|(r, &n)| (r.clone(), n))
        .collect();
    differ.extend(plain.keys().filter(|row| !other.contains_key(*row)).map(|row| (row.clone(), 0)));
    differ
}

fn measured() -> Table {
    let plain = rows(&Effects::default(), &AttributeSet::new());
    let mut table = Table::new();
    for asked in asked() {
        let differ = difference(&plain, &rows(&asked.effects, &asked.attributes));
        table.insert(asked.name.to_owned(), differ);
    }
    let with_intensity = Effects { intensity: Some(Intensity), ..Effects::default() };
    let without = rows(&with_intensity, &AttributeSet::new());
    let stored = rows(&with_intensity, &[Attribute::Intensity].into());
    table.insert(Attribute::Intensity.name().to_owned(), difference(&without, &stored));
    table.insert(PLAIN.to_owned(), plain);
    table
}

fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/only_what_is_asked.toml")
}

#[test]
fn costs_are_those_of_the_table() {
    let measured = measured();
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        let heading = "# What a scan costs and what each thing asked for adds to it. Written by \
                       `UPDATE_GOLDEN=1 cargo test -p tests --test only_what_is_asked`.\n\n";
        fs::write(golden(), heading.to_owned() + &toml::to_string(&measured).unwrap()).unwrap();
    }
    let expected: Table = toml::from_str(&fs::read_to_string(golden()).unwrap()).unwrap();
    for (name, rows) in &expected {
        assert_eq!(measured.get(name), Some(rows), "{name}; if that is meant, UPDATE_GOLDEN=1");
    }
    assert_eq!(measured.len(), expected.len(), "the table holds all that can be asked for");
}

#[test]
fn each_thing_asked_for_changes_its_own_rows_only() {
    let measured = measured();
    for asked in asked() {
        for row in measured[asked.name].keys() {
            assert!(asked.owns(row), "{} changes {row:?}", asked.name);
        }
    }
    let stored = &measured[Attribute::Intensity.name()];
    assert!(stored.keys().all(|row| row.starts_with("point, ")), "{stored:?}");
}

#[test]
fn a_plain_scene_pays_for_no_effect() {
    let plain = rows(&Effects::default(), &AttributeSet::new());
    for asked in asked().iter().filter(|asked| asked.attributes.is_empty()) {
        let with_it = rows(&asked.effects, &AttributeSet::new());
        for (row, cost) in difference(&with_it, &plain) {
            assert!(cost < *with_it.get(&row).unwrap_or(&0), "{}: {row:?}", asked.name);
        }
    }
    assert_eq!(plain["shader, bind groups"], 1);
    assert_eq!(plain["ray, bytes of effect outputs read back"], 0);
    assert_eq!(plain["ray, bytes of codes read back"], 4);
    assert_eq!(plain["point, bytes in npz"], 12);
    assert_eq!(plain["point, bytes in ply"], 12);
}
