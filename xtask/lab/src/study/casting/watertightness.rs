//! Rays through the vertices and edges of a closed mesh: the common f32 intersection test
//! loses some of them, the watertight test none.

use crate::measure::accuracy::Accuracy;
use crate::measure::bench_mesh::target;
use crate::measure::clock::{Costs, interleave, workload};
use crate::measure::methods;
use crate::measure::ray_set::RaySet;
use crate::measure::scenes::{closed_sphere, edge_midpoints};
use crate::render::table::{Column, Table, digits, millions_per_s};
use anyhow::Result;
use formats::rng::StreamKey;
use glam::DVec3;
use serde::Serialize;
use sim_gpu::internals::bvh::Builder;

/// How rays become ranges.
type Method = fn(&RaySet) -> Vec<Option<f64>>;

const METHODS: [(&str, Method); 3] = [
    ("cpu f64 oracle", methods::in_f64),
    ("cpu f32 Möller-Trumbore, f32 range", methods::moller_trumbore),
    ("cpu f32 watertight, f32 range", methods::watertight_in_f32),
];

/// One method on one set of rays.
#[derive(Serialize)]
struct Setting {
    scene: &'static str,
    knobs: &'static str,
    rays: usize,
    /// Rays that hit in f64.
    hits: usize,
    costs: Costs,
    #[serde(flatten)]
    accuracy: Accuracy,
}

/// Every method on both sets of rays.
#[derive(Serialize)]
pub struct Watertightness {
    settings: Vec<Setting>,
}

/// Casts rays from within a closed sphere through its vertices and its edges' midpoints.
pub fn measure(rounds: usize) -> Result<Watertightness> {
    let sphere = closed_sphere(5);
    let through = [("at vertices", sphere.vertices.clone()), ("at edges", edge_midpoints(&sphere))];
    let target = target(sphere, Builder::Sah);
    let mut settings = Vec::new();
    for (scene, points) in through {
        let rays = &RaySet::through(&target, &places_within(), &points);
        let truth = methods::in_f64(rays);
        let mut workloads = METHODS.map(|(_, method)| workload(move || Ok(method(rays))));
        let costs = interleave(rounds, &mut workloads)?;
        settings.extend(METHODS.iter().zip(costs).map(|((knobs, method), costs)| Setting {
            scene,
            knobs,
            rays: truth.len(),
            hits: truth.iter().flatten().count(),
            costs,
            accuracy: Accuracy::of(&method(rays), &truth),
        }));
    }
    Ok(Watertightness { settings })
}

/// Twenty places within [`closed_sphere`].
fn places_within() -> Vec<DVec3> {
    let key = StreamKey::new(0, "places within", 0);
    let coordinate = |n: u64| 0.8 * key.unit(n) - 0.4;
    let place =
        |i: u64| DVec3::new(coordinate(3 * i), coordinate(3 * i + 1), coordinate(3 * i + 2));
    (0..20).map(place).collect()
}

impl Watertightness {
    /// The figures as a table.
    pub fn table(&self) -> Table {
        let columns: [Column<'_, Setting>; 5] = [
            ("rays", &|setting| setting.scene.to_owned()),
            ("method", &|setting| setting.knobs.to_owned()),
            ("lost %", &|setting| digits(1e-4 * setting.accuracy.misses_per_million())),
            ("M rays/CPU-s", &|s| millions_per_s(s.rays, s.costs.cpu_s().median)),
            ("worst error m", &|setting| digits(setting.accuracy.worst_m)),
        ];
        let title = "Rays lost at vertices and edges of a closed sphere";
        Table::of(title, &self.settings, &columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_watertight_test_loses_no_ray() {
        let measured = measure(1).unwrap();
        let misses = |name: &str| {
            let of = measured.settings.iter().filter(|setting| setting.knobs.contains(name));
            of.map(|setting| setting.accuracy.misses).collect::<Vec<_>>()
        };
        assert_eq!(misses("watertight"), [0, 0]);
        assert!(misses("Möller-Trumbore").iter().all(|&misses| misses > 0));
    }
}
