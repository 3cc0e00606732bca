//! Cases of effects with extreme parameters, for a sensor inside a cube.

use formats::scan::{Attribute, Column};
use glam::DVec3;
use serde::Deserialize;
use sim_gpu::effects::Effects;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, scan_objects};
use sim_gpu::internals::sensor::SensorProfile;
use tests::adapter::casters;
use tests::{casting, meshes};

/// A VLP-32C in the middle of a cube with one reflectivity.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InCube {
    /// Effects with the keys of a scene. Each is applied in its own scan.
    effects: Vec<toml::Table>,
    half_m: f64,
    #[serde(default = "white")]
    reflectivity: f32,
    expect: Expect,
}

#[derive(Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum Expect {
    Refused { refused: String },
    Points { points: [usize; 2], range_m: Option<[f32; 2]> },
}

fn white() -> f32 {
    1.0
}

impl InCube {
    pub fn check(&self) {
        for table in &self.effects {
            let parsed: Result<Effects, _> = table.clone().try_into();
            match (&self.expect, parsed) {
                (Expect::Refused { refused }, parsed) => {
                    let error = parsed.expect_err("these effects are refused").to_string();
                    assert!(error.contains(refused), "{table}: {error}");
                }
                (Expect::Points { points, range_m }, parsed) => {
                    let effects = parsed.unwrap_or_else(|error| panic!("{table}: {error}"));
                    self.judge(&effects, *points, range_m.unwrap_or([0.0, f32::MAX]));
                }
            }
        }
    }

    fn judge(&self, effects: &Effects, points: [usize; 2], range_m: [f32; 2]) {
        let sensor = SensorProfile::builtin("vlp32c").expect("it is built in");
        let pattern = effects.widen(sensor.pattern(), &sensor).expect("a pattern");
        let half = DVec3::splat(self.half_m);
        let target = casting::target(&meshes::cuboid(-half, half));
        let mut placed = PlacedTarget::new(&target);
        placed.reflectivity = self.reflectivity;
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X).expect("a pose");
        let mut request = ScanRequest::new(&sensor, &pattern, pose);
        request.attributes = Attribute::ALL.into_iter().collect();
        request.attributes.remove(&Attribute::Intensity);
        let mut first = None;
        for caster in casters(effects) {
            let scan = scan_objects(caster, std::slice::from_ref(&placed), &request);
            let scan = scan.unwrap_or_else(|error| panic!("{effects:?}: {error}")).scan;
            let found = scan.len();
            assert!((points[0]..=points[1]).contains(&found), "{effects:?}: {found} points");
            assert!(scan.positions.as_flattened().iter().all(|x| x.is_finite()), "{effects:?}");
            for (attribute, column) in scan.columns() {
                if let Column::F32(values) = column {
                    assert!(values.iter().all(|x| x.is_finite()), "{effects:?}: {attribute}");
                }
            }
            let ranges_m = scan.range_m.as_ref().expect("it was asked for");
            let is_there = |r: &f32| (range_m[0]..=range_m[1]).contains(r);
            let outside = ranges_m.iter().find(|r| !is_there(r));
            assert!(outside.is_none(), "{effects:?}: a point at {} m", outside.unwrap_or(&0.0));
            let all = first.get_or_insert_with(|| scan.clone());
            assert!(*all == scan, "{effects:?}: {} differs", caster.name());
        }
    }
}
