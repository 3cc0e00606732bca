//! The whole pipeline: a mesh in a scene is scanned with effects, and the cloud is sampled and
//! classified. Far from the origin, the pipeline gives the same results as at the origin.

use std::path::{Path, PathBuf};

use glam::{DVec3, dvec3};
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options, Precision};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::scene::SceneFile;
use sim_gpu::{Caster, Scene};
use tests::adapter::casters;

/// Largest distance of a point, relative to the sensor, from the same point at the origin, metres.
const WITHIN_M: f64 = 1e-4;
/// Largest difference of logits in f32, as a share of the largest logit.
const LOGITS_WITHIN: f64 = 1e-3;
const POINTS: usize = 16;

/// A chair with a radius of 40 m, 1e7 m from the origin of the world, is scanned from 200 m with
/// 0.1 m of noise and a quantum of 4 mm, sampled to 16 points, and classified in all precisions.
///
/// Coordinates of 1e7 m are multiples of 2^-29 m = 2e-9 m. Ranges change by this times the tangent
/// of the incidence. A range so close to the border of a quantum changes by 4 mm, which is unlikely
/// for a few hundred points. Positions are f32, relative to a whole metre near the sensor: up to
/// 200 m, two roundings change them by 1.5e-5 m. Therefore the cloud agrees with that at the origin
/// within 1e-4 m, or 2.5e-6 of its radius, and the logits within 1e-3.
pub fn a_chair_far_away_and_noisy_is_classified_as_at_the_origin() {
    let scenes = [dvec3(1e7, -1e7, 1e7), DVec3::ZERO].map(scene);
    for caster in casters(&scenes[0].effects) {
        let [there, here] = scenes.each_ref().map(|scene| scan(scene, caster));
        let what = format!("{} points on {}", there.len(), caster.name());
        assert!(there.len() >= 64, "{what}");
        assert_eq!(there.len(), here.len(), "{what}");
        let sensors = scenes.each_ref().map(|scene| scene.sensors[0].pose.position_m);
        for (&a, &b) in there.iter().zip(&here) {
            let apart = (a - sensors[0]) - (b - sensors[1]);
            assert!(apart.abs().max_element() <= WITHIN_M, "{what}: {a}, {b}");
        }
        Precision::ALL.into_iter().for_each(|p| assert_same_class(p, &what, &there, &here));
    }
}

fn assert_same_class(precision: Precision, what: &str, there: &[DVec3], here: &[DVec3]) {
    let sampler = SamplerSpec { kind: SamplerKind::Fps, points: POINTS, ..SamplerSpec::default() };
    let options = Options { precision, sampler: Some(sampler), ..Options::default() };
    let model = assets().join("weights/edge-64.safetensors");
    let mut classifier = Classifier::load(&model, &options).unwrap();
    let [(label, logits), (expected, reference)] = [there, here].map(|cloud| {
        let cloud: Vec<_> = cloud.iter().map(DVec3::to_array).collect();
        let found = classifier.classify_f64(&cloud).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(found.n_used, POINTS, "{what}");
        (found.label.clone(), found.logits.clone())
    });
    assert_eq!(label, expected, "{what}, {precision}");
    if precision == Precision::F32 {
        crate::classify::assert_same(what, LOGITS_WITHIN, &reference, &logits);
    }
}

fn scene(at: DVec3) -> SceneFile {
    let mesh = assets().join("meshes/chair/chair_0046.obj").display().to_string();
    let [at_m, from_m] = [at, at + 200.0 * DVec3::X].map(|place| place.to_array());
    let text = format!(
        "seed = 5\n[[object]]\nmesh = {mesh:?}\nnormalize = \"unit-sphere\"\n\
         scale = 40.0\nposition_m = {at_m:?}\n\
         [[sensor]]\nprofile = \"vlp32c\"\nposition_m = {from_m:?}\nlook_at_m = {at_m:?}\n\
         [effects]\nnoise = {{ sigma_m = 0.1 }}\nquantise_m = true\n",
    );
    SceneFile::parse(&text, Path::new("chain.toml")).unwrap()
}

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
}

fn scan(scene: &SceneFile, caster: &OpenCaster) -> Vec<DVec3> {
    let caster = Caster::named(caster.name()).unwrap();
    let scan = Scene::try_from(scene).unwrap().scan_mounted(0).with(&caster).run().unwrap();
    let origin = DVec3::from_array(scan.origin);
    let in_world = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from)) + origin;
    scan.positions.iter().map(in_world).collect()
}
