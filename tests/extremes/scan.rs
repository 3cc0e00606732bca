//! Cases of one mesh and one sensor. The hits of all casters, with and without culling, are
//! compared with the f64 oracle and with the expected output.

use edgepuck_mesh::TriangleMesh;
use glam::{DQuat, DVec3};
use serde::Deserialize;
use sim_gpu::effects::Effects;
use sim_gpu::internals::bvh::{Builder, assert_well_formed};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::cpu::oracle;
use sim_gpu::internals::job::{CastJob, Culling};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::resolve::{Hits, resolve};
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::Target;
use tests::adapter::casters;
use tests::casting::{beams, builtin, job_with, ranges, target_by};
use tests::judge::{judge, near_silhouette};
use tests::meshes::mapped;
use tests::random::Random;

use crate::shape::Shape;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scan {
    mesh: Shape,
    /// The builder: `morton`, or the surface area heuristic if absent.
    builder: Option<String>,
    sensor: Place,
    beams: Beams,
    knob: Option<Knob>,
    expect: Expect,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "a sensor has `at_m` or `distance_m`", deny_unknown_fields)]
enum Place {
    At { at_m: DVec3, quaternion_xyzw: Option<DQuat> },
    View { distance_m: f64, elevation_deg: f64, azimuth_deg: f64 },
}

/// `at-segment` aims at equidistant points, both ends included.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Beams {
    Sensor(String),
    Directions(Vec<DVec3>),
    Random(usize),
    AtPoints(Vec<DVec3>),
    AtBox { n: usize, low: DVec3, high: DVec3 },
    AtSegment { n: u32, from: DVec3, to: DVec3 },
    AtCornersAndEdges {},
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Knob {
    Scale(Vec<f64>),
    /// Offsets of the mesh and the sensor, metres.
    OffsetM(Vec<DVec3>),
    /// Distances of the sensor from the origin in its direction, metres.
    DistanceM(Vec<f64>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Expect {
    ranges: Option<Ranges>,
    /// Largest relative error of `ranges`.
    #[serde(default = "roundings")]
    relative: f64,
    hits: Option<usize>,
    hits_at_least: Option<usize>,
    decided_in_f64: Option<usize>,
    /// The relation of the hits at each value of the parameter to those without it.
    same: Option<Same>,
    /// Whether hits are compared with the oracle. False for rays whose hits are undefined.
    #[serde(default = "yes")]
    judged: bool,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "`aim`, `leaves-cube`, `miss`, or a list of ranges")]
enum Ranges {
    All(Rule),
    /// The range of each beam, metres; `inf` for a beam that misses.
    Each(Vec<f64>),
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Rule {
    /// All beams end at their targets.
    Aim,
    /// All beams end at the cube from -1 to 1, in which the sensor is.
    LeavesCube,
    Miss,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Same {
    /// All beams hit the same triangles, and the scaled ranges differ by at most this share.
    Relative(f64),
    /// Largest difference of ranges, metres, and largest number of beams that may differ more, each
    /// at a silhouette.
    Metres { within: f64, silhouettes: usize },
}

fn roundings() -> f64 {
    1e-12
}

fn yes() -> bool {
    true
}

#[derive(Clone, Copy, Debug)]
enum Setting {
    Plain,
    Scale(f64),
    OffsetM(DVec3),
    DistanceM(f64),
}

struct Scene {
    target: Target,
    pose: Pose,
    pattern: BeamPattern,
    ranges: Option<Vec<Option<f64>>>,
}

impl Scan {
    pub fn check(&self) {
        let settings = self.knob.as_ref().map_or(vec![Setting::Plain], Knob::settings);
        let reference = self.expect.same.as_ref().map(|same| (same, self.cast_all(Setting::Plain)));
        for setting in settings {
            let (scene, found) = self.cast_all(setting);
            if let Some((same, (first, reference))) = &reference {
                for (reference, found) in reference.iter().zip(&found) {
                    same.check(setting, (first, reference), (&scene, found));
                }
            }
        }
    }

    fn cast_all(&self, setting: Setting) -> (Scene, Vec<Hits>) {
        let scene = self.scene(setting);
        let check = |caster: &&OpenCaster| {
            let what = format!("{setting:?} on {}", caster.name());
            let [hits, unculled] = [Culling::On, Culling::Off].map(|c| scene.cast(caster, c));
            assert_eq!(hits, unculled, "{what}: culling");
            if self.expect.judged {
                judge(&scene.job(Culling::On), &scene.pattern, &hits).assert_kept(&what);
            }
            self.expect.check(&what, &scene, &hits);
            hits
        };
        let found = casters(&Effects::default()).iter().map(check).collect();
        (scene, found)
    }

    fn scene(&self, setting: Setting) -> Scene {
        let builder = match self.builder.as_deref() {
            None => Builder::Sah,
            Some("morton") => Builder::Morton,
            Some(other) => panic!("`builder`: expected `morton`, found `{other}`"),
        };
        let mesh = self.mesh.mesh();
        let pose = self.sensor.pose(setting);
        let mut random = Random::new("aims");
        let (pattern, aims) = self.beams.pattern(&mesh, pose.position_m, &mut random);
        let ranges = self.expect.ranges.as_ref().map(|ranges| {
            let found = ranges.of(pose.position_m, &pattern, aims.as_deref());
            found.into_iter().map(|range| range.map(|range| range * setting.scale())).collect()
        });
        let target = target_by(builder, &mapped(&mesh, |v| setting.moved(v)));
        assert_well_formed(&target.bvh);
        let pose = Pose { position_m: setting.moved(pose.position_m), ..pose };
        Scene { target, pose, pattern, ranges }
    }
}

impl Scene {
    /// Casts like a scan: a target that is too large for the adapter is cast on the CPU.
    fn cast(&self, caster: &OpenCaster, culling: Culling) -> Hits {
        let job = self.job(culling);
        let jobs = std::slice::from_ref(&job);
        let casts = match caster.fits(&self.target) {
            true => caster.cast(jobs).unwrap_or_else(|error| panic!("{error}")),
            false => caster.cast_on_cpu(jobs),
        };
        resolve(&job, &casts[0], &self.pattern, &Effects::default())
    }

    fn job(&self, culling: Culling) -> CastJob {
        job_with(&self.target, &self.pose, &self.pattern, culling)
    }
}

impl Place {
    fn pose(&self, setting: Setting) -> Pose {
        let distance = if let Setting::DistanceM(metres) = setting { Some(metres) } else { None };
        match self {
            Self::At { at_m, quaternion_xyzw } => {
                let back = |distance| at_m.normalize() * distance;
                Pose {
                    position_m: distance.map_or(*at_m, back),
                    rotation: quaternion_xyzw.unwrap_or(DQuat::IDENTITY),
                }
            }
            Self::View { distance_m, elevation_deg, azimuth_deg } => {
                let distance = distance.unwrap_or(*distance_m);
                let (elevation, azimuth) = (elevation_deg.to_radians(), azimuth_deg.to_radians());
                Pose::view(distance, elevation, azimuth, DVec3::ZERO)
            }
        }
    }
}

impl Beams {
    fn pattern(
        &self,
        mesh: &TriangleMesh,
        sensor: DVec3,
        random: &mut Random,
    ) -> (BeamPattern, Option<Vec<DVec3>>) {
        let points: Vec<DVec3> = match self {
            Self::Sensor(name) => return (builtin(name), None),
            Self::Directions(list) => return (beams(list.iter().copied()), None),
            Self::Random(n) => return (beams((0..*n).map(|_| random.direction())), None),
            Self::AtPoints(list) => list.clone(),
            Self::AtBox { n, low, high } => {
                let within = |at: DVec3| low + (high - low) * (at * 0.5 + 0.5);
                (0..*n).map(|_| within(random.in_cube())).collect()
            }
            Self::AtSegment { n, from, to } => {
                let along = |i| f64::from(i) / f64::from(n - 1);
                (0..*n).map(|i| from + (to - from) * along(i)).collect()
            }
            Self::AtCornersAndEdges {} => corners_and_edges(mesh),
        };
        (beams(points.iter().map(|&point| point - sensor)), Some(points))
    }
}

fn corners_and_edges(mesh: &TriangleMesh) -> Vec<DVec3> {
    let of = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize]);
        [a, b, c, a.midpoint(b), b.midpoint(c), c.midpoint(a)]
    };
    mesh.triangles.iter().flat_map(of).collect()
}

impl Knob {
    fn settings(&self) -> Vec<Setting> {
        match self {
            Self::Scale(values) => values.iter().copied().map(Setting::Scale).collect(),
            Self::OffsetM(values) => values.iter().copied().map(Setting::OffsetM).collect(),
            Self::DistanceM(values) => values.iter().copied().map(Setting::DistanceM).collect(),
        }
    }
}

impl Setting {
    fn scale(self) -> f64 {
        if let Self::Scale(factor) = self { factor } else { 1.0 }
    }

    fn moved(self, place: DVec3) -> DVec3 {
        if let Self::OffsetM(offset) = self { place + offset } else { place * self.scale() }
    }
}

impl Ranges {
    fn of(&self, sensor: DVec3, pattern: &BeamPattern, aims: Option<&[DVec3]>) -> Vec<Option<f64>> {
        let rule = match self {
            Self::Each(list) => {
                assert_eq!(list.len(), pattern.len(), "`expect.ranges`: one a beam");
                return list
                    .iter()
                    .map(|&range| (range < f64::INFINITY).then_some(range))
                    .collect();
            }
            Self::All(rule) => *rule,
        };
        match rule {
            Rule::Miss => vec![None; pattern.len()],
            Rule::Aim => {
                let aims = aims.expect("`expect.ranges = \"aim\"` is for beams at points");
                aims.iter().map(|&aim| Some((aim - sensor).length())).collect()
            }
            Rule::LeavesCube => {
                let leaves = |d: &DVec3| ((d.signum() - sensor) / *d).min_element();
                pattern.directions.iter().map(|d| Some(leaves(d))).collect()
            }
        }
    }
}

impl Expect {
    fn check(&self, what: &str, scene: &Scene, hits: &Hits) {
        let (n, in_f64) = (hits.hits.len(), hits.decided_in_f64);
        assert!(self.hits.is_none_or(|expected| n == expected), "{what}: {n} hits");
        assert!(self.hits_at_least.is_none_or(|least| n >= least), "{what}: {n} hits");
        assert!(self.decided_in_f64.is_none_or(|m| in_f64 == m), "{what}: {in_f64} in f64");
        let Some(expected) = &scene.ranges else {
            let says = self.hits.is_some() || self.hits_at_least.is_some() || self.same.is_some();
            assert!(says, "`expect` says nothing");
            return;
        };
        for (beam, pair) in ranges(hits, &scene.pattern).into_iter().zip(expected).enumerate() {
            let same = match pair {
                (Some(found), Some(expected)) => {
                    (found - expected).abs() <= self.relative * expected
                }
                (found, expected) => found == *expected,
            };
            assert!(same, "{what}, beam {beam}: {:?} is not {:?}", pair.0, pair.1);
        }
    }
}

impl Same {
    fn check(&self, setting: Setting, first: (&Scene, &Hits), second: (&Scene, &Hits)) {
        match self {
            Self::Relative(tolerance) => {
                assert_eq!(first.1.hits.len(), second.1.hits.len(), "{setting:?}");
                for (one, other) in first.1.hits.iter().zip(&second.1.hits) {
                    let [a, b] = [one, other].map(|hit| (hit.beam, hit.triangle));
                    assert_eq!(a, b, "{setting:?}");
                    let error = (other.range_m / setting.scale() / one.range_m - 1.0).abs();
                    assert!(error < *tolerance, "{setting:?}: {error:e}");
                }
            }
            Self::Metres { within, silhouettes } => {
                let differing = differing(first, second, *within);
                assert!(differing <= *silhouettes, "{setting:?}: {differing} beams");
            }
        }
    }
}

/// The number of beams with another range, each of which must be at a silhouette.
fn differing(first: (&Scene, &Hits), second: (&Scene, &Hits), within: f64) -> usize {
    let [here, there] = [first, second].map(|(scene, hits)| ranges(hits, &scene.pattern));
    let job = first.0.job(Culling::On);
    let mut differing = 0;
    for (beam, pair) in here.into_iter().zip(there).enumerate() {
        let same = match pair {
            (Some(here), Some(there)) => (here - there).abs() < within,
            (here, there) => here.is_none() && there.is_none(),
        };
        if !same {
            let ray = job.frame.ray(first.0.pattern.directions[beam]);
            let truth = oracle::nearest(&job.target, &ray);
            assert!(near_silhouette(&job.target, &ray, truth), "beam {beam}: {pair:?}");
            differing += 1;
        }
    }
    differing
}
