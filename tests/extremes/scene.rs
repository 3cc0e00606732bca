//! Cases of scenes with very many objects.

use std::fmt::Write;

use formats::scan::Attribute;
use glam::DVec3;
use serde::Deserialize;
use sim_gpu::effects::Effects;
use sim_gpu::internals::scene::SceneFile;
use sim_gpu::{Caster, Scan, Scene};
use tests::adapter::casters;
use tests::meshes::cuboid;

/// Cubes of 1 m on a square lattice, scanned from above the middle.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManyObjects {
    objects: usize,
    apart_m: f64,
    /// Height of the sensor above the middles of the cubes, metres.
    height_m: f64,
    sensor: String,
    expect: Expect,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Expect {
    points_at_least: usize,
    /// Smallest number of different objects that points are on.
    seen_at_least: usize,
    /// Largest distance of a point from its cube, and largest difference of a range from that to
    /// the nearest cube, metres.
    within_m: f64,
}

/// Number of points whose cube is searched among all cubes.
const JUDGED: usize = 500;

impl ManyObjects {
    pub fn check(&self) {
        let folder = tempfile::tempdir().expect("a folder");
        let cube = cuboid(DVec3::splat(-0.5), DVec3::splat(0.5));
        edgepuck_shapes::write_off(&cube, &folder.path().join("cube.off")).expect("a mesh");
        let file = folder.path().join("scene.toml");
        let scene = SceneFile::parse(&self.text(), &file).unwrap_or_else(|error| panic!("{error}"));
        let scene = Scene::try_from(&scene).expect("the mesh is there");
        for caster in casters(&Effects::default()) {
            let caster = Caster::named(caster.name()).expect("the adapter that was listed opens");
            let scan = scene.scan_mounted(0).with(&caster).run();
            let scan = scan.unwrap_or_else(|error| panic!("{}: {error}", caster.name()));
            self.judge(&scene, &scan, caster.name());
        }
    }

    fn text(&self) -> String {
        let mut text = format!(
            "attributes = [\"object\"]\n[[sensor]]\nprofile = {:?}\nposition_m = [0.0, 0.0, {:?}]\nyaw_deg = 0.0\n",
            self.sensor, self.height_m
        );
        for i in 0..self.objects {
            let at = self.place(i);
            let (x, y) = (at.x, at.y);
            let _ = write!(
                text,
                "[[object]]\nmesh = \"cube.off\"\nname = \"{i}\"\nposition_m = [{x:?}, {y:?}, 0.0]\n"
            );
        }
        text
    }

    fn place(&self, i: usize) -> DVec3 {
        let side = (self.objects as f64).sqrt().ceil() as usize;
        // Off the middle of the lattice, so that beams do not systematically meet edges.
        let along = |k: usize| (k as f64 - (side - 1) as f64 / 2.0) * self.apart_m + 0.123;
        DVec3::new(along(i % side), along(i / side), 0.0)
    }

    fn judge(&self, scene: &Scene, found: &Scan, caster: &str) {
        let Expect { points_at_least, seen_at_least, within_m } = self.expect;
        let points = &found.positions;
        assert!(points.len() >= points_at_least, "{caster}: {} points", points.len());
        let objects = found.object.as_ref().expect("the attribute was asked for");
        assert!(scene.attributes.contains(&Attribute::Object));
        let mut seen = objects.clone();
        seen.sort_unstable();
        seen.dedup();
        assert!(seen.len() >= seen_at_least, "{caster}: {} objects seen", seen.len());
        let sensor = scene.sensors[0].pose.position_m;
        let step = points.len().div_ceil(JUDGED);
        for (i, (point, &object)) in points.iter().zip(objects).enumerate() {
            let point = DVec3::from_array(point.map(f64::from));
            let off = ((point - self.place(object as usize)).abs().max_element() - 0.5).abs();
            assert!(off <= within_m, "{caster}, point {i}: {off:e} m off object {object}");
            if i % step == 0 {
                let range = (point - sensor).length();
                let nearest = self.nearest(sensor, (point - sensor) / range);
                let apart = (range - nearest).abs();
                assert!(apart <= within_m, "{caster}, point {i}: {apart:e} m behind");
            }
        }
    }

    /// The nearest of all cubes along a ray, by slabs.
    fn nearest(&self, origin: DVec3, direction: DVec3) -> f64 {
        let enters = |i: usize| {
            let from = origin - self.place(i);
            let (t0, t1) = ((-0.5 - from) / direction, (0.5 - from) / direction);
            let (enter, leave) = (t0.min(t1).max_element(), t0.max(t1).min_element());
            (enter <= leave && enter > 0.0).then_some(enter)
        };
        (0..self.objects).filter_map(enters).fold(f64::INFINITY, f64::min)
    }
}
