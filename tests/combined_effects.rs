//! Effects together, against a plain f64 reference that is written from "Order" of
//! sim-gpu/EFFECTS.md: each pair, and all at once in each return mode.

use formats::rng::StreamKey;
use formats::scan::Attribute;
use glam::{DQuat, DVec3};
use sim_gpu::effects::{
    Detection, Dropout, Effects, EvenMotion, Footprint, Intensity, Noise, NoiseModel, Quantum,
    ReturnMode, Volume, Weather,
};
use sim_gpu::internals::cpu::random::normal_deviate;
use sim_gpu::internals::pose::Trajectory;
use sim_gpu::internals::scan::Glass;
use sim_gpu::internals::sensor::{BeamPattern, DetectionLimit, RangeLimits};
use sim_gpu::internals::weather::{Air, AirBeam, Medium, Scattered};
use sim_gpu::{Caster, Mesh, Pose, Scene, Sensor};
use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::fmt::Write;
use tests::adapter;

/// A panel across the x axis.
struct Panel {
    name: &'static str,
    x_m: f64,
    y_m: [f64; 2],
    reflectivity: f64,
    retroreflection: f64,
    /// The part of the beams that it returns.
    returned: f64,
    /// Along y.
    speed_m_s: f64,
}

const PANEL: Panel = Panel {
    name: "",
    x_m: 0.0,
    y_m: [0.0; 2],
    reflectivity: 0.5,
    retroreflection: 0.0,
    returned: 1.0,
    speed_m_s: 0.0,
};

/// How far a panel reaches above and below the sensor, metres.
const HIGH_M: f64 = 4.0;

/// Edges within and beyond the receiver's separation of 1 m, two panels at one place, one that is
/// nearer than the sensor sees, glass, a retro-reflector, and one that moves. Every number is one
/// of f32.
const WORLD: [Panel; 8] = [
    Panel { name: "near", x_m: 1.5, y_m: [-1.0, -0.875], ..PANEL },
    Panel { name: "front", x_m: 8.0, y_m: [-1.0, 0.5], reflectivity: 0.25, ..PANEL },
    Panel { name: "twin", x_m: 8.0, y_m: [-1.0, 0.5], reflectivity: 0.75, ..PANEL },
    Panel { name: "behind", x_m: 8.5, y_m: [0.25, 1.5], retroreflection: 0.5, ..PANEL },
    Panel { name: "glass", x_m: 5.0, y_m: [1.25, 2.5], returned: 0.5, ..PANEL },
    Panel { name: "moves", x_m: 10.0, y_m: [-4.0, -2.5], speed_m_s: 8.0, ..PANEL },
    Panel { name: "wall", x_m: 20.0, y_m: [-3.0, 9.0], reflectivity: 0.25, ..PANEL },
    Panel { name: "far", x_m: 40.0, y_m: [-40.0, 40.0], ..PANEL },
];

const SENSOR_M: DVec3 = DVec3::new(0.25, -0.5, 0.125);
const RANGE: RangeLimits = RangeLimits { min_m: 2.0, max_m: 30.0, quantum_m: Some(0.004) };
const LIMIT: DetectionLimit = DetectionLimit { reflectivity: 0.15, range_m: 30.0 };
const DIVERGENCE_DEG: [f64; 2] = [0.5, 0.25];
const SEPARATION_M: f64 = 1.0;
const SEED: u64 = 9;
const START_S: f64 = 0.25;
const BEAMS: u32 = 1500;

fn sensor() -> Sensor {
    let mut rows = String::new();
    for i in 0..BEAMS {
        let azimuth_deg = f64::from(i) * 0.03 - 20.0;
        let elevation_deg = f64::from(i * 7 % 11) - 5.0;
        write!(rows, "[{azimuth_deg}, {elevation_deg:?}], ").unwrap();
    }
    let text = format!(
        "name = \"fan\"\n\
         range = {{ min_m = 2.0, max_m = 30.0, quantum_m = 0.004 }}\n\
         detection = {{ reflectivity = 0.15, range_m = 30.0 }}\n\
         footprint = {{ divergence_deg = [0.5, 0.25], separation_m = 1.0 }}\n\
         table = {{ pulse_hz = 15000.0, period_s = 0.1, directions_deg = [{rows}] }}"
    );
    toml::from_str(&text).unwrap()
}

fn scene() -> Scene {
    let mut scene = Scene::new();
    for panel in &WORLD {
        let ([left, right], x) = (panel.y_m, panel.x_m);
        let corners = [(left, -HIGH_M), (right, -HIGH_M), (right, HIGH_M), (left, HIGH_M)];
        let corners = corners.map(|(y, z)| [x, y, z]).to_vec();
        let mesh = Mesh::from_triangles(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let id = scene.add(&mesh, Pose::IDENTITY);
        let instance = &mut scene[id];
        instance.name = Some(panel.name.to_owned());
        instance.reflectivity = panel.reflectivity;
        instance.retroreflection = panel.retroreflection;
        instance.glass = Some(Glass { triangles: 0..2, returned: panel.returned });
        if panel.speed_m_s != 0.0 {
            let poses = [0.0, 1.0].map(|at_s| (at_s, Pose::at([0.0, panel.speed_m_s * at_s, 0.0])));
            instance.motion = Some(Trajectory::new(poses.to_vec()).unwrap().into());
        }
    }
    scene
}

/// One point of a scan.
#[derive(Debug, PartialEq)]
struct Point {
    /// Which echo of the air it is, from 1; 0 for surfaces. Scans do not tell it.
    draw: u32,
    beam: u32,
    number: u8,
    object: u32,
    medium: u8,
    reflectivity: u8,
    intensity: f64,
    range_m: f64,
    power: f64,
    position_m: DVec3,
}

#[derive(Clone, Copy)]
struct Echo {
    range_m: f64,
    power: f64,
    brightness: f64,
    retroreflection: f64,
    /// The object, or the medium of the air.
    source: Result<usize, Medium>,
    /// What its random numbers belong to.
    key: StreamKey,
    ray: u32,
    /// As [`Point::draw`].
    draw: u32,
    cosine: f64,
}

fn unit(bits: u32) -> f64 {
    f64::from(bits) / 4_294_967_296.0
}

fn key_of(name: &str) -> StreamKey {
    StreamKey::new(SEED, &format!("{name}@{START_S}"), 0)
}

fn sensor_at(motion: Option<&EvenMotion>, after_s: f64) -> (DVec3, DQuat) {
    let motion = motion.copied().unwrap_or_default();
    let turn_rad = motion.yaw_rate_deg_s.to_radians() * after_s;
    let moved_m = DVec3::from_array(motion.velocity_m_s) * after_s;
    (SENSOR_M + moved_m, DQuat::from_rotation_z(turn_rad))
}

/// The nearest panel along a ray at a time, and its range. The first of equals wins.
fn hit(from_m: DVec3, along: DVec3, at_s: f64) -> Option<(usize, f64)> {
    let mut nearest = None::<(usize, f64)>;
    for (i, panel) in WORLD.iter().enumerate() {
        let range_m = (panel.x_m - from_m.x) / along.x;
        let at_m = from_m + along * range_m;
        let y_m = at_m.y - panel.speed_m_s * at_s;
        let meets =
            range_m > 0.0 && at_m.z.abs() <= HIGH_M && (panel.y_m[0]..=panel.y_m[1]).contains(&y_m);
        if meets && nearest.is_none_or(|(_, best_m)| range_m < best_m) {
            nearest = Some((i, range_m));
        }
    }
    nearest
}

/// Echoes less than the separation apart are one, of the object or medium that returns most.
fn merge(mut echoes: Vec<Echo>, separation_m: f64) -> Vec<Echo> {
    echoes.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
    let together = echoes.chunk_by(|a, b| b.range_m - a.range_m < separation_m);
    let one = |parts: &[Echo]| {
        let sum = |of: &dyn Fn(&Echo) -> f64| parts.iter().map(of).sum::<f64>();
        let of_source = |own: &Echo| sum(&|e| if e.source == own.source { e.power } else { 0.0 });
        let weight = |e: &Echo| (of_source(e), e.power);
        let most = |best: Echo, e: &Echo| match weight(e).partial_cmp(&weight(&best)) {
            Some(Ordering::Greater) => *e,
            _ => best,
        };
        let (power, brightness) = (sum(&|e| e.power), sum(&|e| e.brightness));
        let range_m = sum(&|e| e.power * e.range_m) / power;
        Echo { range_m, power, brightness, ..parts.iter().fold(parts[0], most) }
    };
    together.map(|parts| if parts.len() == 1 { parts[0] } else { one(parts) }).collect()
}

/// The places of the returns that the sensor reports.
fn select(echoes: &[Echo], mode: ReturnMode) -> Vec<usize> {
    let mut by_power: Vec<usize> = (0..echoes.len()).collect();
    by_power.sort_by(|&a, &b| echoes[b].power.total_cmp(&echoes[a].power));
    let last = echoes.len() - 1;
    let (strongest, second) = (by_power[0], *by_power.get(1).unwrap_or(&by_power[0]));
    let mut places = match mode {
        ReturnMode::Strongest => vec![strongest],
        ReturnMode::SecondStrongest => vec![second],
        ReturnMode::First => vec![0],
        ReturnMode::Last => vec![last],
        ReturnMode::Dual if strongest == last => vec![second, last],
        ReturnMode::Dual => vec![strongest, last],
    };
    places.dedup();
    places
}

/// A scan by "Order" of EFFECTS.md.
struct Plain<'a> {
    effects: &'a Effects,
    detection: Detection,
    rays: &'a BeamPattern,
    air: Option<Air>,
}

fn reference(sensor: &Sensor, effects: &Effects) -> Vec<Point> {
    let rays = sensor.rays(effects).unwrap();
    let weather = effects.weather.as_deref();
    let air = weather.map(|weather| Air::new(weather, DIVERGENCE_DEG, &LIMIT, &RANGE));
    let detection = effects.detection.unwrap_or_default();
    let plain = Plain { effects, detection, rays: &rays, air };
    (0..BEAMS).flat_map(|beam| plain.points(beam)).collect()
}

impl Plain<'_> {
    fn points(&self, beam: u32) -> Vec<Point> {
        let axis = beam * self.rays.rays_per_beam;
        let after_s = f64::from(beam) / 15_000.0;
        let (from_m, turned) = sensor_at(self.effects.motion.as_deref(), after_s);
        let direction = turned * self.rays.directions[axis as usize];
        let (mut echoes, end_m) = self.surface_echoes(axis, from_m, turned, START_S + after_s);
        if let Some(air) = &self.air {
            let stream = key_of("scan");
            let along = AirBeam { origin: from_m, direction, end_m, stream, number: beam };
            add_air_echoes(air, &along, axis, &mut echoes);
        }
        let mut echoes = merge(echoes, SEPARATION_M);
        echoes.retain(|echo| self.is_detected(echo));
        if echoes.is_empty() {
            return Vec::new();
        }
        let places = select(&echoes, self.effects.returns.unwrap_or_default());
        let point = |place: usize| {
            let echo = &echoes[place];
            let at_m = self.measured(echo, direction)?;
            Some(self.point(echo, beam, place as u8 + 1, at_m, turned))
        };
        places.into_iter().filter_map(point).collect()
    }

    /// The echoes of what the rays of a beam meet, and where the beam ends.
    fn surface_echoes(
        &self,
        axis: u32,
        from_m: DVec3,
        turned: DQuat,
        at_s: f64,
    ) -> (Vec<Echo>, f64) {
        let per_beam = self.rays.rays_per_beam;
        let mut echoes = Vec::new();
        let (mut n_hits, mut farthest_m) = (0, 0.0f64);
        for ray in axis..axis + per_beam {
            let along = turned * self.rays.directions[ray as usize];
            let Some((object, range_m)) = hit(from_m, along, at_s) else { continue };
            (n_hits, farthest_m) = (n_hits + 1, farthest_m.max(range_m));
            let panel = &WORLD[object];
            let key = key_of(panel.name);
            if !(RANGE.min_m..=RANGE.max_m).contains(&range_m)
                || unit(key.words([axis, 16, 0, 0])[0]) >= panel.returned
            {
                continue;
            }
            let (cosine, retroreflection) = (along.x.abs(), panel.retroreflection);
            let bright = if retroreflection > 0.0 { 1.0 } else { panel.reflectivity * cosine };
            let through =
                self.air.as_ref().map_or(1.0, |air| air.transmission(from_m, along, range_m));
            let brightness = bright * through / f64::from(per_beam);
            let (source, power) = (Ok(object), brightness / range_m.powi(2));
            let echo = Echo {
                range_m,
                power,
                brightness,
                retroreflection,
                source,
                key,
                ray,
                draw: 0,
                cosine,
            };
            echoes.push(echo);
        }
        let end_m = if n_hits < per_beam { RANGE.max_m } else { farthest_m.min(RANGE.max_m) };
        (echoes, end_m)
    }

    fn is_detected(&self, echo: &Echo) -> bool {
        let noise = self
            .detection
            .threshold_to_noise
            .map_or(0.0, |ratio| normal_deviate(echo.key.words([echo.ray, 3, 0, 0])[0]) / ratio);
        // Weather needs a limit, and takes the sensor's own.
        let is_limited = self.effects.detection.is_some() || self.air.is_some();
        !is_limited || echo.power + noise * least_power() >= least_power()
    }

    /// Where the sensor measures an echo, from its own place; `None` if it is lost.
    fn measured(&self, echo: &Echo, direction: DVec3) -> Option<DVec3> {
        let bits = |purpose| echo.key.words([echo.ray, purpose, 0, 0]);
        if self.effects.dropout.is_some_and(|lost| unit(bits(2)[0]) < lost.probability) {
            return None;
        }
        let (mut range_m, mut aside_m) = (echo.range_m, DVec3::ZERO);
        if let Some(noise) = self.effects.noise {
            let [x, y, z, _] = bits(1).map(normal_deviate);
            // In the f32 of shaders.
            let error = |z: f64| f64::from((noise.mean_m + noise.sigma_m * z) as f32);
            match noise.model {
                NoiseModel::Range => range_m += error(x),
                NoiseModel::Xyz => aside_m = DVec3::new(error(x), error(y), error(z)),
            }
        }
        if let Some(sigma_m) = self.detection.range_sigma_m {
            let weakness = (least_power() / echo.power.max(least_power())).sqrt();
            range_m += sigma_m * weakness * normal_deviate(bits(3)[1]);
        }
        if let Some(step_m) = self.effects.quantum.and_then(|quantum| quantum.step_m) {
            range_m = (range_m / step_m).round() * step_m;
        }
        (range_m > 0.0).then_some(direction * range_m + aside_m)
    }

    fn point(&self, echo: &Echo, beam: u32, number: u8, at_m: DVec3, turned: DQuat) -> Point {
        let byte = match echo.retroreflection {
            retro if retro > 0.0 => 101.0 + 154.0 * retro,
            _ => (100.0 * echo.brightness).min(100.0),
        };
        let lit = echo.source.map_or(0.0, |object| WORLD[object].reflectivity * echo.cosine);
        Point {
            draw: echo.draw,
            beam,
            number,
            object: echo.source.map_or(u32::MAX, |object| object as u32),
            medium: echo.source.err().unwrap_or_default() as u8,
            reflectivity: byte.round() as u8,
            intensity: if self.air.is_some() { echo.brightness } else { lit },
            range_m: at_m.length(),
            power: echo.power,
            // Distorted by the motion.
            position_m: SENSOR_M + turned.inverse() * at_m,
        }
    }
}

fn least_power() -> f64 {
    LIMIT.reflectivity / LIMIT.range_m.powi(2)
}

/// Adds what the air returns, each echo with random numbers of its own.
fn add_air_echoes(air: &Air, along: &AirBeam, ray: u32, echoes: &mut Vec<Echo>) {
    let StreamKey([low, high]) = along.stream;
    let mut draw = 0u32;
    air.scatter(along, |Scattered { range_m, power, brightness, medium }| {
        draw += 1;
        let key = StreamKey([low, high ^ 0x9E37_79B9u32.wrapping_mul(draw)]);
        let (source, retroreflection, cosine) = (Err(medium), 0.0, 0.0);
        let echo =
            Echo { range_m, power, brightness, retroreflection, source, key, ray, draw, cosine };
        echoes.extend((range_m >= RANGE.min_m).then_some(echo));
    });
}

fn scanned(scene: &Scene, sensor: &Sensor, effects: &Effects, caster: &Caster) -> Vec<Point> {
    let everything = Attribute::ALL.into_iter().filter(|of| *of != Attribute::Normal);
    let scan = scene
        .scan(sensor, Pose { position_m: SENSOR_M, rotation: DQuat::IDENTITY })
        .with(caster)
        .effects(effects.clone())
        .attributes(everything)
        .seed(SEED)
        .start_s(START_S)
        .run()
        .unwrap();
    let f64s = |column: &Option<Vec<f32>>| -> Vec<f64> {
        column.as_ref().unwrap().iter().map(|&x| x.into()).collect()
    };
    let (ranges, powers, intensities) =
        (f64s(&scan.range_m), f64s(&scan.power), f64s(&scan.intensity));
    let origin = DVec3::from_array(scan.origin);
    let point = |i: usize| Point {
        draw: 0,
        beam: scan.beam.as_ref().unwrap()[i],
        number: scan.return_number.as_ref().unwrap()[i],
        object: scan.object.as_ref().unwrap()[i],
        medium: scan.medium.as_ref().unwrap()[i],
        reflectivity: scan.reflectivity.as_ref().unwrap()[i],
        intensity: intensities[i],
        range_m: ranges[i],
        power: powers[i],
        position_m: origin + DVec3::from_array(scan.positions[i].map(f64::from)),
    };
    (0..scan.len()).map(point).collect()
}

/// f32 holds a coordinate below 32 m within 2^-20 m, and a power or an intensity within 2^-24 of
/// itself; the reference and the CPU each err by some 1e-14. An adapter's noise of 0.02 m errs by up to
/// 3e-7 m, and is rounded to f32 (`tests::effects`).
fn assert_same(found: &[Point], expected: &[Point], of: &str) {
    assert_eq!(found.len(), expected.len(), "{of}: points");
    for (found, expected) in found.iter().zip(expected) {
        let whole = |p: &Point| (p.beam, p.number, p.object, p.medium, p.reflectivity);
        let parts = |p: &Point| [p.power, p.intensity];
        let most_m = 2f64.powi(-20) + 4e-7;
        let are_near = (found.range_m - expected.range_m).abs() <= most_m
            && (found.position_m - expected.position_m).abs().max_element() <= most_m
            && parts(found).iter().zip(parts(expected)).all(|(a, b)| (a - b).abs() <= 1e-7 * b);
        assert!(
            whole(found) == whole(expected) && are_near,
            "{of}:\nfound    {found:?}\nexpected {expected:?}"
        );
    }
}

type Ask = fn(&mut Effects);

/// Each effect, with numbers that matter in this world.
const ASKED: [(&str, Ask); 11] = [
    ("noise along the range", |e| e.noise = Some(noise(NoiseModel::Range))),
    ("noise of each coordinate", |e| e.noise = Some(noise(NoiseModel::Xyz))),
    ("dropout", |e| e.dropout = Some(Dropout { probability: 0.25 })),
    ("detection", |e| {
        let (threshold_to_noise, range_sigma_m) = (Some(4.0), Some(0.03));
        e.detection = Some(Detection { limit: None, threshold_to_noise, range_sigma_m });
    }),
    ("footprint", |e| {
        e.footprint = Some(Footprint { samples: 7, divergence_deg: None, separation_m: None });
    }),
    ("dual returns", |e| e.returns = Some(ReturnMode::Dual)),
    ("the last return", |e| e.returns = Some(ReturnMode::Last)),
    ("weather", |e| {
        // Around the sensor, too, where it measures nothing.
        let min_m = [-2.0, -4.0, -2.0];
        let dust = Volume { min_m, max_m: [6.0, 0.5, 2.0], visibility_m: 100.0 };
        let (rain_mm_h, haze_visibility_m) = (Some(80.0), Some(3000.0));
        // Spray behind the dust, so that a beam has several echoes of the air.
        let spray = Volume { min_m: [6.5, -4.0, -2.0], max_m: [7.5, 0.5, 2.0], visibility_m: 5.0 };
        let volumes = vec![dust, spray];
        let weather = Weather { rain_mm_h, haze_visibility_m, volumes, ..Weather::default() };
        e.weather = Some(Box::new(weather));
    }),
    ("motion", |e| {
        let velocity_m_s = [4.0, -3.0, 0.5];
        e.motion = Some(Box::new(EvenMotion { velocity_m_s, yaw_rate_deg_s: 40.0 }));
    }),
    ("the quantum", |e| e.quantum = Some(Quantum { step_m: Some(0.05) })),
    ("intensity", |e| e.intensity = Some(Intensity)),
];

fn noise(model: NoiseModel) -> Noise {
    Noise { mean_m: 0.01, sigma_m: 0.02, model }
}

#[test]
fn each_pair_of_effects_is_that_of_the_plain_reference() {
    let (scene, sensor) = (scene(), sensor());
    let nothing = reference(&sensor, &Effects::default());
    for (i, (name, ask)) in ASKED.into_iter().enumerate() {
        for (other, also) in &ASKED[i..] {
            let mut effects = Effects::default();
            ask(&mut effects);
            also(&mut effects);
            let expected = reference(&sensor, &effects);
            assert!(expected.len() > 300, "{name} and {other}: {}", expected.len());
            assert_same(
                &scanned(&scene, &sensor, &effects, &Caster::cpu()),
                &expected,
                &format!("{name} and {other}"),
            );
        }
        let mut alone = Effects::default();
        ask(&mut alone);
        // Without a width or weather, a beam has one echo; intensity is asked for by its attribute.
        let changes = !["dual returns", "the last return", "intensity"].contains(&name);
        assert_eq!(reference(&sensor, &alone) != nothing, changes, "{name}");
    }
}

#[test]
fn all_effects_together_are_those_of_the_plain_reference_in_each_return_mode() {
    let (scene, sensor) = (scene(), sensor());
    let (mut seen, mut draws) = (BTreeSet::new(), BTreeSet::new());
    for model in NoiseModel::ALL {
        for mode in ReturnMode::ALL {
            let mut effects = Effects::default();
            ASKED.iter().for_each(|(_, ask)| ask(&mut effects));
            (effects.noise, effects.returns) = (Some(noise(model)), Some(mode));
            let expected = reference(&sensor, &effects);
            // An adapter casts the same rays in each mode.
            let n_casters = if mode == ReturnMode::Dual { usize::MAX } else { 1 };
            for caster in adapter::casters(&Effects::default()).into_iter().take(n_casters) {
                let caster = Caster::named(caster.name()).unwrap();
                let found = scanned(&scene, &sensor, &effects, &caster);
                assert_same(&found, &expected, &format!("{model} {mode} on {}", caster.name()));
            }
            seen.extend(expected.iter().map(|point| (point.object, point.medium)));
            draws.extend(expected.iter().map(|point| point.draw));
        }
    }
    // All that the sensor can see took part: five panels, rain and dust.
    assert_eq!(seen.len(), 7, "{seen:?}");
    // And the second echo of the air in a beam, with random numbers of its own.
    assert!(draws.contains(&2), "{draws:?}");
}
