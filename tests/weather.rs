//! Weather in scans, against closed forms: on every caster, in scenes, beside other effects.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::DVec3;
use sim_gpu::caster::Caster;
use sim_gpu::effects::{
    Detection, DetectionLimit, Effects, FogModel, Footprint, ReturnMode, Volume, Weather,
};
use sim_gpu::job::Culling;
use sim_gpu::mesh::Mesh;
use sim_gpu::pose::Pose;
use sim_gpu::scan::{PlacedTarget, ScanRequest, Tally, scan_objects};
use sim_gpu::sensor::Sensor;
use sim_gpu::weather::Medium;
use tests::{adapter, casting, meshes};

const WALL_M: f64 = 30.0;

/// The inside of a ball around the sensor: every beam meets it at one range, squarely.
fn ball() -> Mesh {
    meshes::mapped(&meshes::icosphere(5), |p| p * WALL_M)
}

/// The effects of this weather for a sensor that sees 90 % at 200 m.
fn in_weather(weather: Weather) -> Effects {
    let limit = Some(DetectionLimit { reflectivity: 0.9, range_m: 200.0 });
    let detection = Some(Detection { limit, ..Detection::default() });
    Effects { detection, weather: Some(Box::new(weather)), ..Effects::default() }
}

fn rain(mm_h: f64) -> Weather {
    Weather { rain_mm_h: Some(mm_h), ..Weather::default() }
}

fn scan(caster: &Caster, mesh: &Mesh, reflectivity: f32, culling: Culling) -> (Scan, Tally) {
    let sensor = Sensor::builtin("vlp32c").unwrap();
    let pattern = caster.effects().widen(sensor.pattern(), &sensor).unwrap();
    let target = casting::target(mesh);
    let mut placed = PlacedTarget::new(&target);
    placed.reflectivity = reflectivity;
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X).unwrap();
    let mut request = ScanRequest::new(&sensor, &pattern, pose);
    request.attributes = Attribute::ALL.into_iter().collect();
    request.attributes.remove(&Attribute::Intensity);
    (request.stream, request.culling) = (StreamKey([3, 5]), culling);
    let scanned = scan_objects(caster, &[placed], &request).unwrap();
    (scanned.scan, scanned.tally)
}

fn on_cpu(effects: &Effects, reflectivity: f32) -> (Scan, Tally) {
    scan(&Caster::Cpu(effects.clone()), &ball(), reflectivity, Culling::On)
}

fn count(scan: &Scan, medium: Medium) -> usize {
    scan.medium.as_ref().unwrap().iter().filter(|&&of| of == medium as u8).count()
}

#[test]
fn all_casters_see_the_same_weather_with_and_without_culling() {
    let volume = Volume { min_m: [3.0, -5.0, -5.0], max_m: [6.0; 3], visibility_m: 20.0 };
    let all = Weather {
        rain_mm_h: Some(30.0),
        snow_mm_h: Some(1.0),
        fog_visibility_m: Some(200.0),
        haze_visibility_m: Some(5e3),
        volumes: vec![volume],
        ..Weather::default()
    };
    let footprint = Some(Footprint { samples: 7, divergence_deg: None, separation_m: None });
    let effects = Effects { footprint, returns: Some(ReturnMode::Dual), ..in_weather(all) };
    let mesh = meshes::mapped(&meshes::icosphere(3), |p| p * 4.0 + DVec3::X * 15.0);
    let scans: Vec<_> = adapter::casters(&effects)
        .into_iter()
        .flat_map(|caster| [Culling::On, Culling::Off].map(|c| scan(caster, &mesh, 0.5, c)))
        .collect();
    assert!(scans[0].1.scattered > 1000 && scans[0].1.points > scans[0].1.scattered);
    for medium in [Medium::Rain, Medium::Fog, Medium::Dust, Medium::Surface] {
        assert!(count(&scans[0].0, medium) > 0, "{medium}");
    }
    assert!(scans.iter().all(|scan| scan.0 == scans[0].0 && scan.1 == scans[0].1));
}

#[test]
fn no_weather_is_clear_air_to_the_bit() {
    let clear = Effects { weather: None, ..in_weather(Weather::default()) };
    let none = [Weather::default(), rain(0.0), Weather { snow_mm_h: Some(0.0), ..rain(0.0) }];
    for weather in none {
        assert_eq!(on_cpu(&in_weather(weather), 0.5), on_cpu(&clear, 0.5));
    }
}

#[test]
fn rain_replaces_as_many_returns_as_its_closed_form_says() {
    // At 30 m and 30 mm/h drops are stronger than a surface of 10 % in 2.79 % of LISA's beams of
    // 3 by 3 mrad: a beam of half the area has half as many drops, but more of them are strong
    // enough. The integral of the density by another program, for 3 by 1.5 mrad and drops from
    // 1 m: see the module `weather`.
    let (scan, tally) = on_cpu(&in_weather(rain(30.0)), 0.1);
    let n = tally.points as f64;
    assert!(n > 50_000.0);
    let width = (0.172f64.to_radians().tan() * 0.086f64.to_radians().tan()).sqrt();
    let (slope, extinction) = (4.1 * 30f64.powf(-0.21), 3.67e-4 * 30f64.powf(0.63));
    let limit: f64 = 0.1 * (-2.0 * extinction * WALL_M).exp() / WALL_M.powi(2);
    let density = |r: f64| {
        let least_mm =
            1000.0 * width * r * r * (limit * (2.0 * extinction * r).exp() / 0.019_853).sqrt();
        let per_m3 = 8000.0 / slope * (-slope * least_mm.max(0.05)).exp();
        per_m3 * std::f64::consts::PI / 4.0 * (width * r).powi(2)
    };
    let step = 1e-3;
    let mean = (0..29_000).map(|i| density(1.0 + (f64::from(i) + 0.5) * step) * step).sum::<f64>();
    let expected = 1.0 - (-mean).exp();
    let found = count(&scan, Medium::Rain) as f64 / n;
    let sigma = (expected * (1.0 - expected) / n).sqrt();
    assert!((found - expected).abs() < 4.0 * sigma + 1e-4, "{found}, not {expected}");
    assert_eq!(tally.scattered as usize, count(&scan, Medium::Rain));
}

#[test]
fn reflectivity_and_power_are_what_the_air_lets_through() {
    let weather = Weather { haze_visibility_m: Some(500.0), ..Weather::default() };
    let (clear, _) = on_cpu(&Effects { weather: None, ..in_weather(weather.clone()) }, 0.8);
    let (hazy, _) = on_cpu(&in_weather(weather), 0.8);
    assert_eq!(clear.len(), hazy.len());
    let through =
        (-2.0 * WALL_M * 3.912 / 500.0 * (905f64 / 550.0).powf(-0.585 * 0.5f64.cbrt())).exp();
    for (a, b) in clear.power.as_ref().unwrap().iter().zip(hazy.power.as_ref().unwrap()) {
        // The ball's facets are up to 0.4 % nearer than its corners.
        assert!((f64::from(b / a) / through - 1.0).abs() < 2e-3, "{}", b / a);
    }
    let bytes = hazy.reflectivity.as_ref().unwrap();
    assert!(bytes.iter().all(|byte| (f64::from(*byte) - 80.0 * through).abs() < 1.5));
}

#[test]
fn what_is_in_the_air_is_no_surface() {
    let weather = Weather { fog_visibility_m: Some(40.0), ..Weather::default() };
    let (scan, tally) = on_cpu(&in_weather(weather.clone()), 0.1);
    assert!(tally.points > 50_000 && tally.scattered == tally.points, "{tally:?}");
    assert!(scan.triangle.as_ref().unwrap().iter().all(|&triangle| triangle == u32::MAX));
    assert!(scan.object.as_ref().unwrap().iter().all(|&object| object == u32::MAX));
    assert!(scan.normal.as_ref().unwrap().iter().all(|normal| *normal == [0.0; 3]));
    // The last return is the ball, if it is bright enough to come through.
    let last = Effects { returns: Some(ReturnMode::Last), ..in_weather(weather.clone()) };
    assert_eq!(count(&on_cpu(&last, 1.0).0, Medium::Surface), 0, "20 dB too weak");
    let thinner = Weather { fog_visibility_m: Some(80.0), ..weather };
    let last = Effects { returns: Some(ReturnMode::Last), ..in_weather(thinner.clone()) };
    assert!(count(&on_cpu(&last, 1.0).0, Medium::Surface) > 50_000);
    // By Hahner's model every beam beyond a range is fog, whatever it meets.
    let hahner = Weather { fog_model: FogModel::Hahner, ..thinner };
    for reflectivity in [0.2, 1.0] {
        let (scan, _) = on_cpu(&in_weather(hahner.clone()), reflectivity);
        assert_eq!(count(&scan, Medium::Fog), 0, "30 m is not beyond it");
    }
    // An extinction of 0.15 has its range at 17.0 m (by Hahner et al.'s tables), also for
    // beams that are many rays.
    let thick = Weather { fog_visibility_m: Some(20f64.ln() / 0.15), ..hahner };
    let footprint =
        Some(Footprint { samples: 7, divergence_deg: Some([0.1; 2]), separation_m: Some(1.0) });
    for footprint in [None, footprint] {
        // Its fog is weaker than 90 % at 200 m.
        let limit = Some(DetectionLimit { reflectivity: 0.9, range_m: 1000.0 });
        let detection = Some(Detection { limit, ..Detection::default() });
        let effects = Effects { footprint, detection, ..in_weather(thick.clone()) };
        let (scan, tally) = on_cpu(&effects, 1.0);
        assert!(tally.points > 50_000 && count(&scan, Medium::Fog) as u64 == tally.points);
        assert!(scan.range_m.unwrap().iter().all(|range_m| (range_m - 4.56).abs() < 0.05));
    }
}

#[test]
fn beams_that_meet_nothing_return_from_the_air_unless_they_are_told_not_to() {
    let mesh = meshes::mapped(&meshes::icosphere(3), |p| p * 2.0 + DVec3::X * 15.0);
    let with = |empty_beams| {
        let weather = Weather { empty_beams, ..rain(100.0) };
        scan(&Caster::Cpu(in_weather(weather)), &mesh, 0.5, Culling::On)
    };
    let (all, some) = (with(None), with(Some(false)));
    assert_eq!(with(Some(true)), all);
    assert!(all.1.scattered > 3000 && some.1.scattered < all.1.scattered / 10);
    assert_eq!(count(&all.0, Medium::Surface), count(&some.0, Medium::Surface));
}
