//! Weather in scans, against closed forms: on every caster, in scenes, beside other effects.

use edgepuck_mesh::TriangleMesh;
use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::DVec3;
use sim_gpu::effects::{Detection, Effects, Footprint, ReturnMode, Volume, Weather};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::job::Culling;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, Tally, scan_objects};
use sim_gpu::internals::sensor::{DetectionLimit, SensorProfile};
use sim_gpu::internals::weather::Medium;
use tests::{adapter, casting, meshes};

const WALL_M: f64 = 30.0;

/// The inside of a ball around the sensor: every beam meets it at one range, squarely.
fn ball() -> TriangleMesh {
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

fn scan(
    caster: &OpenCaster,
    mesh: &TriangleMesh,
    reflectivity: f32,
    culling: Culling,
) -> (Scan, Tally) {
    scan_with(caster, mesh, reflectivity, culling, None)
}

/// A scan with these `effects` of the caster's, or all of them.
fn scan_with(
    caster: &OpenCaster,
    mesh: &TriangleMesh,
    reflectivity: f32,
    culling: Culling,
    effects: Option<Effects>,
) -> (Scan, Tally) {
    let sensor = SensorProfile::builtin("vlp32c").unwrap();
    let pattern = caster.effects().widen(sensor.pattern(), &sensor).unwrap();
    let target = casting::target(mesh);
    let mut placed = PlacedTarget::new(&target);
    placed.reflectivity = reflectivity;
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X).unwrap();
    let mut request = ScanRequest::new(&sensor, &pattern, pose);
    request.attributes = Attribute::ALL.into_iter().collect();
    request.attributes.remove(&Attribute::Intensity);
    (request.stream, request.culling) = (StreamKey([3, 5]), culling);
    request.effects = effects;
    let scanned = scan_objects(caster, &[placed], &request).unwrap();
    (scanned.scan, scanned.tally)
}

fn on_cpu(effects: &Effects, reflectivity: f32) -> (Scan, Tally) {
    scan(&OpenCaster::Cpu(effects.clone()), &ball(), reflectivity, Culling::On)
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
fn rain_and_snow_replace_as_many_returns_as_their_closed_form_says() {
    // At 30 m and 30 mm/h drops are stronger than a surface of 10 % in 2.79 % of LISA's beams of
    // 3 by 3 mrad: a beam of half the area has half as many drops, but more of them are strong
    // enough. The integral of the density by another program, for 3 by 1.5 mrad and drops from
    // 1 m: see the module `weather`.
    let snow = Weather { snow_mm_h: Some(30.0), ..Weather::default() };
    let width = (0.172f64.to_radians().tan() * 0.086f64.to_radians().tan()).sqrt();
    // The extinction; N0 and the slope of diameters; the index of refraction at 905 nm.
    let of_rain = [3.67e-4 * 30f64.powf(0.63), 8000.0, 4.1 * 30f64.powf(-0.21), 1.328];
    let of_snow = [
        1.447e-3 * 30f64.powf(0.565),
        7600.0 * 30f64.powf(-0.87),
        2.55 * 30f64.powf(-0.48),
        1.3031,
    ];
    for (weather, medium, [extinction, n0, slope, index]) in
        [(rain(30.0), Medium::Rain, of_rain), (snow, Medium::Snow, of_snow)]
    {
        let (scan, tally) = on_cpu(&in_weather(weather), 0.1);
        let n = tally.points as f64;
        assert!(n > 50_000.0);
        let limit: f64 = 0.1 * (-2.0 * extinction * WALL_M).exp() / WALL_M.powi(2);
        let mirror = ((index - 1.0) / (index + 1.0)).powi(2);
        let density = |r: f64| {
            let least = (limit * (2.0 * extinction * r).exp() / mirror).sqrt();
            let least_mm = 1000.0 * width * r * r * least;
            let per_m3 = n0 / slope * (-slope * least_mm.max(0.05)).exp();
            per_m3 * std::f64::consts::PI / 4.0 * (width * r).powi(2)
        };
        let step = 1e-3;
        let mean =
            (0..29_000).map(|i| density(1.0 + (f64::from(i) + 0.5) * step) * step).sum::<f64>();
        let expected = 1.0 - (-mean).exp();
        let found = count(&scan, medium) as f64 / n;
        let sigma = (expected * (1.0 - expected) / n).sqrt();
        assert!((found - expected).abs() < 4.0 * sigma + 1e-4, "{found}, not {expected}");
        assert_eq!(tally.scattered as usize, count(&scan, medium));
    }
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
fn returns_from_the_air_are_not_surfaces() {
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
}

const SEVEN_RAYS: Footprint = Footprint { samples: 7, divergence_deg: None, separation_m: None };

#[test]
fn rays_for_scans_of_wide_beams_are_none_of_narrow_ones_in_weather() {
    let mesh = meshes::mapped(&meshes::icosphere(3), |p| p * 2.0 + DVec3::X * 15.0);
    for empty_beams in [None, Some(false)] {
        let weather = Weather { fog_visibility_m: Some(200.0), empty_beams, ..rain(100.0) };
        let narrow = in_weather(weather);
        let wide = Effects { footprint: Some(SEVEN_RAYS), ..narrow.clone() };
        let alone = scan(&OpenCaster::Cpu(narrow.clone()), &mesh, 0.5, Culling::On);
        let among = scan_with(&OpenCaster::Cpu(wide), &mesh, 0.5, Culling::On, Some(narrow));
        assert!(alone.0 == among.0 && alone.1 == among.1, "{:?}, {:?}", alone.1, among.1);
    }
}

fn pairs(scan: &Scan) -> std::collections::BTreeMap<u32, [f64; 2]> {
    let mut pairs = std::collections::BTreeMap::new();
    let (beams, numbers) = (scan.beam.as_ref().unwrap(), scan.return_number.as_ref().unwrap());
    for ((beam, number), range_m) in beams.iter().zip(numbers).zip(scan.range_m.as_ref().unwrap()) {
        pairs.entry(*beam).or_insert([f64::NAN; 2])[usize::from(*number) - 1] = (*range_m).into();
    }
    pairs.retain(|_, [fog_m, wall_m]| fog_m.is_finite() && wall_m.is_finite());
    pairs
}

#[test]
fn fog_and_a_surface_are_one_return_where_the_sensor_cannot_tell_them_apart() {
    let weather = Weather { fog_visibility_m: Some(50.0), ..Weather::default() };
    let effects = Effects { returns: Some(ReturnMode::Dual), ..in_weather(weather) };
    let of = |range_m: f64| {
        let mesh = meshes::mapped(&meshes::icosphere(5), |p| p * range_m);
        scan(&OpenCaster::Cpu(effects.clone()), &mesh, 0.5, Culling::On).0
    };
    let (near, far) = (of(2.0), of(4.0));
    assert!(near.len() > 50_000 && pairs(&near).is_empty(), "the sensor's own metre");
    assert_eq!(count(&near, Medium::Surface), near.len());
    assert_eq!(pairs(&far).len(), far.len() / 2);
}

#[test]
fn beams_that_meet_nothing_return_from_the_air_unless_it_is_switched_off() {
    let mesh = meshes::mapped(&meshes::icosphere(3), |p| p * 2.0 + DVec3::X * 15.0);
    let with = |empty_beams| {
        let weather = Weather { empty_beams, ..rain(100.0) };
        scan(&OpenCaster::Cpu(in_weather(weather)), &mesh, 0.5, Culling::On)
    };
    let (all, some) = (with(None), with(Some(false)));
    assert_eq!(with(Some(true)), all);
    assert!(all.1.scattered > 3000 && some.1.scattered < all.1.scattered / 10);
    assert_eq!(count(&all.0, Medium::Surface), count(&some.0, Medium::Surface));
}
