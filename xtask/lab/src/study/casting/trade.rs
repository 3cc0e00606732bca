//! Speed against accuracy, for each knob there is.

use crate::measure::accuracy::Accuracy;
use crate::measure::clock::{Contestant, Costs, interleave, measured};
use crate::measure::lanes::Lane;
use crate::measure::scenes::{closed_sphere, edge_midpoints, in_a_room, rippled_plate, torus};
use crate::measure::shot::Shot;
use crate::measure::ways;
use crate::render::table::{Table, digits, millions_per_s, milliseconds};
use crate::study::casting::speed::{short, sweep_pose, target, vlp32c};
use anyhow::Result;
use formats::rng::StreamKey;
use glam::DVec3;
use serde::Serialize;
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::effects::Effects;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::Mesh;
use sim_gpu::pose::Pose;
use sim_gpu::sensor::Sensor;
use std::hint::black_box;
use std::num::NonZeroU32;
use std::sync::Arc;

/// Rays that each repeat casts at least, where that many do not yet fill the
/// adapter.
const RAYS: usize = 200_000;

/// One setting of the knobs on one scene.
#[derive(Serialize)]
struct Setting {
    scene: &'static str,
    knobs: String,
    rays: usize,
    /// Of the rays compared.
    hits: usize,
    costs: Costs,
    #[serde(flatten)]
    accuracy: Accuracy,
}

/// What thinning the azimuth steps leaves.
#[derive(Serialize)]
struct Thinning {
    keep_each: u32,
    beams: usize,
    cast: usize,
    points: usize,
    costs: Costs,
}

/// Everything traded.
#[derive(Serialize)]
pub struct Trade {
    settings: Vec<Setting>,
    thinnings: Vec<Thinning>,
}

/// Measures every knob on `lanes` in `rounds` rounds each.
///
/// # Errors
/// If an adapter fails.
pub fn measure(lanes: &[Lane], rounds: usize) -> Result<Trade> {
    let mut settings = Vec::new();
    for (scene, mesh, aim) in scenes()? {
        eprintln!("{scene}");
        settings.extend(on(scene, mesh, &aim, lanes, rounds)?);
    }
    Ok(Trade { settings, thinnings: thinnings(rounds)? })
}

/// How the rays of a scene are aimed at a target.
type Aim = Box<dyn Fn(&Arc<sim_gpu::target::Target>) -> Shot>;

fn scenes() -> Result<Vec<(&'static str, Mesh, Aim)>> {
    let pose = sweep_pose()?;
    let sweep = |pose: Pose, culling| -> Aim {
        Box::new(move |target| Shot::sweep(target, &pose, &vlp32c(), culling))
    };
    // 2 cm above the plate and level with it.
    let skimming = Pose::look_at(DVec3::new(-0.9, 0.1, 0.02), DVec3::new(0.0, 0.0, 0.02))?;
    let sphere = closed_sphere(5);
    let (corners, middles) = (sphere.vertices.clone(), edge_midpoints(&sphere));
    let through = |points: Vec<DVec3>| -> Aim {
        Box::new(move |target| Shot::through(target, &places_within(), &points))
    };
    Ok(vec![
        ("sweep, room", in_a_room(torus(100_000)), sweep(pose, Culling::Off)),
        ("sweep, object", torus(100_000), sweep(pose, Culling::On)),
        ("grazing", rippled_plate(224), sweep(skimming, Culling::On)),
        ("at vertices", sphere.clone(), through(corners)),
        ("at edges", sphere, through(middles)),
    ])
}

/// Twenty places within [`closed_sphere`].
fn places_within() -> Vec<DVec3> {
    let key = StreamKey::new(0, "places within", 0);
    let coordinate = |n: u64| 0.8 * key.unit(n) - 0.4;
    let place =
        |i: u64| DVec3::new(coordinate(3 * i), coordinate(3 * i + 1), coordinate(3 * i + 2));
    (0..20).map(place).collect()
}

/// Casts so many copies of a shot; answers the ranges of one, metres.
type Way<'a> = Box<dyn Fn(usize) -> Result<Vec<Option<f64>>> + 'a>;

fn on(
    scene: &'static str,
    mesh: Mesh,
    aim: &Aim,
    lanes: &[Lane],
    rounds: usize,
) -> Result<Vec<Setting>> {
    let shot = aim(&target(mesh.clone(), Builder::Sah));
    let by_morton = shot.at(&target(mesh, Builder::Morton));
    let ways = every_way(&shot, &by_morton, lanes);
    let truth = ways::in_f64(&shot);
    let mut settings = Vec::new();
    let mut contestants: Vec<Contestant<'_>> = Vec::new();
    for (knobs, fill, way) in &ways {
        let copies = fill.div_ceil(shot.rays.len().max(1));
        settings.push(Setting {
            scene,
            knobs: knobs.clone(),
            rays: copies * shot.rays.len(),
            hits: truth.iter().flatten().count(),
            costs: Costs::default(),
            accuracy: Accuracy::of(&way(1)?, &truth),
        });
        contestants.push(Box::new(move || {
            let (ranges, cost) = measured(|| way(copies));
            black_box(ranges?);
            Ok(cost)
        }));
    }
    for (setting, costs) in settings.iter_mut().zip(interleave(rounds, &mut contestants)?) {
        setting.costs = costs;
    }
    Ok(settings)
}

/// Each setting of the knobs, with the rays that it takes to measure it.
fn every_way<'a>(
    shot: &'a Shot,
    by_morton: &'a Shot,
    lanes: &'a [Lane],
) -> Vec<(String, usize, Way<'a>)> {
    let repeated = |once: Box<dyn Fn() -> Vec<Option<f64>> + 'a>| -> Way<'a> {
        Box::new(move |copies| {
            (1..copies).for_each(|_| drop(black_box(once())));
            Ok(once())
        })
    };
    let mut ways = vec![
        ("cpu f64 oracle".to_owned(), RAYS, repeated(Box::new(|| ways::in_f64(shot)))),
        (
            "cpu f32 Möller-Trumbore, f32 range".to_owned(),
            RAYS,
            repeated(Box::new(|| ways::moller_trumbore(shot))),
        ),
        (
            "cpu f32 watertight, f32 range".to_owned(),
            RAYS,
            repeated(Box::new(|| ways::watertight_in_f32(shot))),
        ),
    ];
    for lane in lanes {
        let name = short(lane.name());
        let fill = if lane.name() == "cpu" { RAYS } else { lane.rays };
        let way = move |shot: &'a Shot| -> Way<'a> {
            Box::new(move |copies| resolved(&lane.caster, shot, copies))
        };
        ways.push((format!("{name} f32 watertight, f64 range"), fill, way(shot)));
        ways.push((format!("{name} the same, Morton"), fill, way(by_morton)));
    }
    ways
}

fn resolved(caster: &Caster, shot: &Shot, copies: usize) -> Result<Vec<Option<f64>>> {
    let jobs: Vec<CastJob> = vec![shot.job.clone(); copies];
    let mut ranges = Vec::new();
    for cast in caster.cast(&jobs)? {
        ranges = shot.ranges(&cast);
    }
    Ok(ranges)
}

/// What is left of a revolution when only each second or fourth azimuth step
/// is cast: the points grow fewer, none grows less accurate.
fn thinnings(rounds: usize) -> Result<Vec<Thinning>> {
    let object = target(torus(100_000), Builder::Sah);
    let sensor = Sensor::builtin("vlp32c").expect("invariant: this profile is built in");
    let pose = sweep_pose()?;
    let cpu = Caster::Cpu(Effects::default());
    let mut thinnings = Vec::new();
    for keep_each in [1, 2, 4] {
        let thinner = NonZeroU32::new(keep_each).unwrap_or(NonZeroU32::MIN);
        let pattern = sensor.decimated(thinner).pattern();
        let shot = Shot::sweep(&object, &pose, &pattern, Culling::On);
        let points = resolved(&cpu, &shot, 1)?.iter().flatten().count();
        let contestant: Contestant<'_> = Box::new(|| {
            let sweep = || {
                let shot = Shot::sweep(&object, &pose, &pattern, Culling::On);
                resolved(&cpu, &shot, 1)
            };
            let (ranges, cost) = measured(sweep);
            black_box(ranges?);
            Ok(cost)
        });
        let costs = interleave(4 * rounds, &mut [contestant])?.swap_remove(0);
        let (beams, cast) = (pattern.len(), shot.rays.len());
        thinnings.push(Thinning { keep_each, beams, cast, points, costs });
    }
    Ok(thinnings)
}

impl Trade {
    /// The figures for people.
    pub fn tables(&self) -> [Table; 2] {
        let mut settings = Table::new(
            "Speed against accuracy (errors against the f64 oracle)",
            &[
                "scene",
                "knobs",
                "hits %",
                "M rays/CPU-s",
                "M rays/s",
                "worst error m",
                "RMS error m",
                "false hits/M",
                "misses/M",
            ],
        );
        for setting in &self.settings {
            let Setting { scene, knobs, rays, hits, costs, accuracy } = setting;
            settings.push(vec![
                (*scene).to_owned(),
                knobs.clone(),
                digits(100.0 * *hits as f64 / accuracy.rays_compared.max(1) as f64),
                millions_per_s(*rays, costs.cpu_s().median),
                millions_per_s(*rays, costs.wall_s().median),
                digits(accuracy.worst_m),
                digits(accuracy.rms_m),
                digits(accuracy.false_hits_per_million()),
                digits(accuracy.misses_per_million()),
            ]);
        }
        let mut thinnings = Table::new(
            "Fewer azimuth steps: one revolution at 5 m, torus 100000, aimed, cast and solved on cpu",
            &["keep each", "beams", "cast", "points", "CPU ms"],
        );
        for t in &self.thinnings {
            let mut row: Vec<String> =
                [t.keep_each as usize, t.beams, t.cast, t.points].map(|n| n.to_string()).to_vec();
            row.push(milliseconds(t.costs.cpu_s().median));
            thinnings.push(row);
        }
        [settings, thinnings]
    }
}
