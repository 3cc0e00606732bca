//! Five datasets, each learnt from and tested on.

use formats::split::Split;
use train::recipe::{Recipe, Sampling};

use super::context::ExperimentContext;
use super::section::{Cell, Section, Table};

/// The datasets: a name, and where they lie.
pub const SETS: [(&str, &str); 5] = [
    ("uniform samples", "surfaces/surface"),
    ("static clean", "lidar/packed/static-clean"),
    ("static noisy", "lidar/packed/static-noisy"),
    ("rotational clean", "lidar/packed/rotational-clean"),
    ("rotational noisy", "lidar/packed/rotational-noisy"),
];

/// How networks are trained on `clouds` clouds of meshes.
pub fn recipe(context: &ExperimentContext, clouds: usize) -> Recipe {
    Recipe { sampling: Sampling::Random, ..context.plan.on_meshes(clouds) }
}

/// The network trained on the set at `place`.
pub fn network(context: &ExperimentContext, place: &str) -> anyhow::Result<std::path::PathBuf> {
    let clouds = context.scans(place, Split::Train)?;
    let name = format!("on-{}", place.replace('/', "-"));
    context.network(&name, recipe(context, clouds.len()), &clouds)
}

pub fn run(context: &ExperimentContext) -> anyhow::Result<Section> {
    let columns = SETS.map(|(name, _)| format!("tested on {name}"));
    let mut instance = Table::new("2 instance", "Instance accuracy", "trained on", &columns);
    let mut class = Table::new("2 class", "Class accuracy", "trained on", &columns);
    for (name, place) in SETS {
        let model = network(context, place)?;
        let found = SETS.map(|(_, place)| context.test_on(place, &model));
        let found = found.into_iter().collect::<anyhow::Result<Vec<_>>>()?;
        instance.push(name, found.iter().map(Cell::instance));
        class.push(name, found.iter().map(Cell::class));
    }
    let n_classes = context.scans(SETS[0].1, Split::Train)?.classes.len();
    let about = [
        format!(
            "Data: {}, the same meshes and the same split in all five. {} points; as many \
             epochs each as come nearest above {} steps. A guess is right in {:.1} %.",
            context.meshes_are,
            context.plan.mesh_points,
            context.plan.mesh_steps,
            100.0 / n_classes as f64
        ),
        "The paper's accuracy across datasets falls to 2 to 17 %. Its uniform samples are the \
         baseline's text files, in a frame of their own; here all five share one frame."
            .to_owned(),
    ];
    Ok(Section::new("Five datasets by five", about, vec![instance, class]))
}
