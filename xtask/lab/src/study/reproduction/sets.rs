//! Networks of scans by dataset: each tested on all others, errors by class, scans of few points,
//! and noise in training and in tests.

use super::context::{ExperimentContext, test};
use super::page::Section;
use crate::render::table::{Cell, Table};
use crate::study::resume::of_steps;
use anyhow::Context;
use formats::split::Split;
use std::path::{Path, PathBuf};
use train::accuracy_report;
use train::clouds::Clouds;
use train::recipe::{Recipe, Sampling};

/// The datasets: a name, and where they lie.
const SETS: [(&str, &str); 5] = [
    ("uniform samples", "surfaces/surface"),
    ("static clean", "lidar/packed/static-clean"),
    ("static noisy", "lidar/packed/static-noisy"),
    ("rotational clean", "lidar/packed/rotational-clean"),
    ("rotational noisy", NOISY),
];

const NOISY: &str = "lidar/packed/rotational-noisy";

/// Standard deviations of the noise along the ray, and the sets that have it.
const SIGMAS: [(&str, &str); 5] = [
    ("0 m", "lidar/packed/rotational-clean"),
    ("0.01 m", NOISY),
    ("0.02 m", "noise-0.02/packed/rotational-noisy"),
    ("0.05 m", "noise-0.05/packed/rotational-noisy"),
    ("0.1 m", "noise-0.1/packed/rotational-noisy"),
];

const THRESHOLDS: [u32; 6] = [16, 64, 128, 256, 512, 1024];

/// How networks are trained on `clouds` clouds of meshes.
pub fn recipe(context: &ExperimentContext, clouds: usize) -> Recipe {
    let plan = &context.plan;
    let recipe = Recipe { sampling: Sampling::Random, ..plan.at(plan.mesh_points) };
    of_steps(recipe, plan.mesh_steps, clouds)
}

pub fn network(context: &ExperimentContext, place: &str) -> anyhow::Result<PathBuf> {
    let clouds = context.scans(place, Split::Train)?;
    let name = format!("on-{}", place.replace('/', "-"));
    context.network(&name, recipe(context, clouds.len()), &clouds)
}

pub fn matrix(context: &ExperimentContext) -> anyhow::Result<Section> {
    let columns = SETS.map(|(name, _)| format!("tested on {name}"));
    let mut instance = Table::new("Instance accuracy", &["trained on"]);
    instance.heading.extend(columns);
    let mut class = instance.clone();
    class.title = "Class accuracy".to_owned();
    for (name, place) in SETS {
        let model = network(context, place)?;
        let found = SETS.map(|(_, place)| context.test_on(place, &model));
        let found = found.into_iter().collect::<anyhow::Result<Vec<_>>>()?;
        instance.measure(name, found.iter().map(Cell::instance).map(Ok))?;
        class.measure(name, found.iter().map(Cell::class).map(Ok))?;
    }
    let n_classes = context.scans(SETS[0].1, Split::Train)?.classes.len();
    let about = [
        format!(
            "Data: {}, the same meshes and the same split in all five. {} points; each network has \
             the fewest epochs of at least {} steps. A guess is right in {:.1} %.",
            context.meshes_are,
            context.plan.mesh_points,
            context.plan.mesh_steps,
            100.0 / n_classes as f64
        ),
        "The paper's accuracy across datasets falls to 2 to 17 %. Its uniform samples are the \
         baseline's text files, in a frame of their own; here all five share one frame."
            .to_owned(),
    ];
    let tables = vec![("2 instance", instance), ("2 class", class)];
    Ok(Section::new("Five datasets by five", about, tables))
}

pub fn noise(context: &ExperimentContext) -> anyhow::Result<Section> {
    let model = network(context, NOISY)?;
    let held = context.scans(NOISY, Split::Test)?;
    let found = test(&model, &held, None)?;
    let about = [
        format!("Data: {}, scans of a VLP-32C from four sides.", context.meshes_are),
        "The matrix: a row is a true class, a column an answer; darker cells are more frequent, \
         red ones wrong. The threshold filter leaves scans of fewer points out of the test."
            .to_owned(),
    ];
    let mut confusion = Table::new("Confusion on rotational noisy scans", &["class"]);
    confusion.heading.extend(held.classes.iter().cloned());
    for (class, answers) in held.classes.iter().zip(&found.confusion) {
        confusion.measure(class, answers.iter().map(|&n| Ok(Cell::Number(n as f64, 0))))?;
    }
    let tables = vec![
        ("6 confusion", confusion),
        ("6 threshold", thresholds(&held, &model)?),
        ("6 noise", sweep(context)?),
    ];
    Ok(Section {
        drawings: vec![accuracy_report::drawing(&found, &held.classes)],
        ..Section::new("Confusion, few points, noise", about, tables)
    })
}

fn thresholds(held: &Clouds, model: &Path) -> anyhow::Result<Table> {
    let n_raw = held.set.n_raw.as_ref();
    let n_raw = n_raw.with_context(|| format!("{NOISY}-test.npz: expected n_raw, found none"))?;
    let title = "Rotational noisy scans of a least number of points";
    let mut table = Table::new(title, &["points", "scans kept", "instance accuracy"]);
    for least in THRESHOLDS {
        let kept: Vec<usize> = (0..held.len()).filter(|&i| n_raw[i] >= least).collect();
        let accuracy = match kept.is_empty() {
            true => Cell::EMPTY,
            false => Cell::instance(&test(model, &held.select(&kept), None)?),
        };
        let share = Cell::Share(kept.len(), held.len());
        table.measure(least.to_string(), [share, accuracy].map(Ok))?;
    }
    Ok(table)
}

fn sweep(context: &ExperimentContext) -> anyhow::Result<Table> {
    let mut table = Table::new("Instance accuracy by noise along the ray", &["trained with"]);
    table.heading.extend(SIGMAS.map(|(sigma, _)| format!("tested with {sigma}")));
    for (sigma, place) in SIGMAS {
        let model = network(context, place)?;
        let tested = |(_, place)| Ok(Cell::instance(&context.test_on(place, &model)?));
        table.measure(sigma, SIGMAS.map(tested))?;
    }
    Ok(table)
}
