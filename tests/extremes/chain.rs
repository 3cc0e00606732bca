//! Cases of the whole chain: a mesh in a scene is scanned with effects, and the
//! cloud sampled and classified. What the chain gives anywhere is what it gives at
//! the world's origin.

use std::path::{Path, PathBuf};

use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options, Precision};
use serde::Deserialize;
use sim_gpu::caster::Caster;
use sim_gpu::job::Culling;
use sim_gpu::scene::{Scene, cast};
use tests::adapter::casters;

/// A mesh, where it stands, how it is seen, and what remains of it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chain {
    /// Below `assets/meshes`; scaled to the unit sphere first.
    mesh: PathBuf,
    /// Radius of the mesh in the scene, metres.
    radius_m: f64,
    /// Where it stands, metres.
    at_m: [f64; 3],
    /// How far off the sensor stands, along x, metres.
    distance_m: f64,
    sensor: String,
    noise_m: f64,
    /// To the sensor's own quantum.
    quantised: bool,
    /// A bundled model.
    model: String,
    /// Points that farthest point sampling keeps.
    points: usize,
    expect: Expect,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Expect {
    /// Points of the scan at least.
    points_at_least: usize,
    /// How far a point may be from where it is at the origin, from the sensor,
    /// metres.
    within_m: f64,
    /// How far apart logits may be in f32, as a part of the largest.
    logits_within: f64,
}

impl Chain {
    /// Runs the chain here and at the origin, on every caster, in every precision.
    pub fn check(&self) {
        let scene = self.scene(self.at_m);
        let at_origin = self.scene([0.0; 3]);
        for caster in casters(&scene.effects) {
            let there = scan(&scene, caster);
            let here = scan(&at_origin, caster);
            let what = format!("{} points on {}", there.len(), caster.name());
            assert!(there.len() >= self.expect.points_at_least, "{what}");
            assert_eq!(there.len(), here.len(), "{what}");
            let sensors = [&scene, &at_origin].map(|s| s.sensors[0].pose.position_m.to_array());
            for (a, b) in there.iter().zip(&here) {
                for axis in 0..3 {
                    let apart = (a[axis] - sensors[0][axis]) - (b[axis] - sensors[1][axis]);
                    assert!(apart.abs() <= self.expect.within_m, "{what}: {a:?}, {b:?}");
                }
            }
            Precision::ALL.into_iter().for_each(|p| self.classify(p, &what, &there, &here));
        }
    }

    fn classify(&self, precision: Precision, what: &str, there: &[[f64; 3]], here: &[[f64; 3]]) {
        let kind = SamplerKind::Fps;
        let sampler = SamplerSpec { kind, points: self.points, ..SamplerSpec::default() };
        let options = Options { precision, sampler: Some(sampler), ..Options::default() };
        let model = assets().join(format!("weights/{}.safetensors", self.model));
        let mut classifier = Classifier::load(&model, &options).unwrap_or_else(|e| panic!("{e}"));
        let mut answer = |cloud: &[[f64; 3]]| {
            let found = classifier.classify_f64(cloud).unwrap_or_else(|e| panic!("{what}: {e}"));
            assert_eq!(found.n_used, self.points, "{what}");
            (found.label.clone(), found.logits.clone())
        };
        let [(label, logits), (expected, reference)] = [answer(there), answer(here)];
        assert_eq!(label, expected, "{what}, {precision}");
        if precision == Precision::F32 {
            let largest = reference.iter().fold(0.0f32, |most, x| most.max(x.abs()));
            let worst = logits.iter().zip(&reference).map(|(a, b)| (a - b).abs());
            let worst = f64::from(worst.fold(0.0f32, f32::max));
            let bound = self.expect.logits_within * f64::from(largest);
            assert!(worst <= bound, "{what}: {worst:e}");
        }
    }

    fn scene(&self, at: [f64; 3]) -> Scene {
        let Self { radius_m, distance_m, sensor, noise_m, quantised, .. } = self;
        let mesh = assets().join("meshes").join(&self.mesh);
        let mesh = mesh.display();
        let from = [at[0] + distance_m, at[1], at[2]];
        let text = format!(
            "seed = 5\n[[object]]\nmesh = {mesh:?}\nnormalize = \"unit-sphere\"\n\
             scale = {radius_m:?}\nposition_m = {at:?}\n\
             [[sensor]]\nprofile = {sensor:?}\nposition_m = {from:?}\nlook_at_m = {at:?}\n\
             [effects]\nnoise = {{ sigma_m = {noise_m:?} }}\nquantise_m = {quantised}\n",
            mesh = mesh.to_string(),
        );
        Scene::parse(&text, Path::new("chain.toml")).unwrap_or_else(|error| panic!("{error}"))
    }
}

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
}

/// The points in the world.
fn scan(scene: &Scene, caster: &Caster) -> Vec<[f64; 3]> {
    let scans = cast(scene, caster, Culling::On).unwrap_or_else(|error| panic!("{error}"));
    let scan = &scans[0].scan;
    let in_world = |p: &[f32; 3]| [0, 1, 2].map(|axis| f64::from(p[axis]) + scan.origin[axis]);
    scan.positions.iter().map(in_world).collect()
}
