use super::*;

const LISA_DIVERGENCE_DEG: [f64; 2] = [0.171_887_338_539_246_97; 2];

/// The sensor that LISA assumes.
fn lisa(weather: &Weather) -> Air {
    let limit = DetectionLimit { reflectivity: 0.9, range_m: 200.0 };
    let range = RangeLimits { min_m: 1.5, max_m: 200.0, quantum_m: None };
    Air::new(weather, LISA_DIVERGENCE_DEG, &limit, &range)
}

fn rain(mm_h: f64) -> Weather {
    Weather { rain_mm_h: Some(mm_h), ..Weather::default() }
}

fn beam(end_m: f64, number: u32) -> AirBeam {
    let stream = StreamKey([7, 9]);
    AirBeam { origin: DVec3::ZERO, direction: DVec3::X, end_m, stream, number }
}

fn scattered(air: &Air, beam: &AirBeam) -> Vec<Scattered> {
    let mut all = Vec::new();
    air.scatter(beam, |one| all.push(one));
    all
}

/// A binomial's standard deviation.
fn sigma(p: f64, n: u32) -> f64 {
    (p * (1.0 - p) / f64::from(n)).sqrt()
}

#[test]
fn rain_takes_the_place_of_a_surface_as_often_as_its_closed_form_and_lisa_say() {
    // The probability that a drop is stronger than a surface of reflectivity 0.1 and than the
    // limit: 1 - exp(-mu), mu the integral of their density by an adaptive rule; beside it the
    // figure that LISA itself gives, with its standard deviation.
    const BEAMS: u32 = 40_000;
    for (mm_h, end_m, closed, lisas, lisas_sigma) in [
        (10.0, 60.0, 0.0554, 0.0555, 0.0030),
        (30.0, 30.0, 0.0279, 0.0262, 0.0021),
        (30.0, 60.0, 0.1045, 0.1077, 0.0040),
        (100.0, 30.0, 0.0712, 0.0690, 0.0033),
        (100.0, 100.0, 0.1933, 0.1940, 0.0072),
    ] {
        let air = lisa(&rain(mm_h));
        let surface = 0.1 * air.transmission(DVec3::ZERO, DVec3::X, end_m) / (end_m * end_m);
        let replaced = (0..BEAMS).filter(|&number| {
            scattered(&air, &beam(end_m, number)).iter().any(|drop| drop.power > surface)
        });
        let found = replaced.count() as f64 / f64::from(BEAMS);
        let own = sigma(closed, BEAMS);
        assert!((found - closed).abs() < 4.0 * own + 5e-5, "{mm_h}, {end_m}: {found}");
        assert!((found - lisas).abs() < 4.0 * own.hypot(lisas_sigma), "{mm_h}, {end_m}: {found}");
    }
}

#[test]
fn drops_are_detected_and_lie_between_the_sensor_and_the_surface() {
    let air = lisa(&rain(100.0));
    let limit = 0.9 / 200f64.powi(2);
    let all: Vec<_> = (0..20_000).flat_map(|i| scattered(&air, &beam(6.0, i))).collect();
    assert!(all.len() > 500);
    assert!(all.iter().all(|drop| (1.5..=6.0).contains(&drop.range_m) && drop.power >= limit));
    assert!(all.iter().all(|drop| drop.medium == Medium::Rain));
    // By Poisson's law, the mean number is minus the logarithm of the share of beams without.
    let air = lisa(&rain(300.0));
    let counts: Vec<usize> = (0..20_000).map(|i| scattered(&air, &beam(100.0, i)).len()).collect();
    let none = counts.iter().filter(|n| **n == 0).count() as f64 / 20_000.0;
    let mean = counts.iter().sum::<usize>() as f64 / 20_000.0;
    assert!((mean + none.ln()).abs() < 4.0 * sigma(none, 20_000) / none, "{mean} {none}");
}

#[test]
fn rain_weakens_by_mies_theory_a_little_more_than_by_ulbrich_and_atlas() {
    // 1.45 R^0.64 dB/km one way, which Mie's theory exceeds by 5 to 10 %.
    for mm_h in [1.0, 10.0, 50.0] {
        let one_way_db_km = 1000.0 * drops::rain_extinction(mm_h) * 10.0 / std::f64::consts::LN_10;
        let ratio = one_way_db_km / (1.45 * mm_h.powf(0.64));
        assert!((1.04..1.11).contains(&ratio), "{mm_h}: {ratio}");
    }
}

#[test]
fn haze_is_koschmieders_at_550_nm_and_thinner_in_the_infrared() {
    for visibility_m in [500.0, 5e3, 23e3, 80e3] {
        let of_visible = 3.912 / visibility_m;
        let found = haze_extinction(visibility_m);
        assert!(found < of_visible && found > 0.4 * of_visible, "{visibility_m}");
    }
    // HELIOS++ leaves kilometres and nanometres unconverted; by hand, for 23 km: q = 1.3.
    for (km, q) in [
        (5.999, 0.585 * 5.999f64.cbrt()),
        (6.0, 1.3),
        (6.5, 1.3),
        (23.0, 1.3),
        (50.0, 1.3),
        (50.001, 1.6),
    ] {
        let by_hand = 3.912 / km * (905.0f64 / 550.0).powf(-q) / 1000.0;
        assert!((haze_extinction(1e3 * km) / by_hand - 1.0).abs() < 1e-12, "{km} km");
    }
}

#[test]
fn fog_weakens_by_its_visibility_and_returns_by_itself() {
    let weather = Weather { fog_visibility_m: Some(50.0), ..Weather::default() };
    let air = lisa(&weather);
    // At its visibility a contrast of 5 % is left, one way.
    let through = air.transmission(DVec3::ZERO, DVec3::X, 50.0);
    assert!((through - 0.05 * 0.05).abs() < 1e-12);
    let [fog] = scattered(&air, &beam(30.0, 0))[..] else { panic!("expected one return") };
    // The maximum of its pulse, 4.64 m, less half of the pulse's length of 6 m.
    assert!((fog.range_m - 1.64).abs() < 0.02 && fog.medium == Medium::Fog);
    assert!(scattered(&air, &beam(1.5, 0)).is_empty(), "a surface before it");
}

#[test]
fn beams_along_a_face_of_a_box_are_inside() {
    let volume = Volume { min_m: [0.0, -1.0, 0.0], max_m: [3.0, 1.0, 3.0], visibility_m: 5.0 };
    let dusty = Weather { volumes: vec![volume], ..rain(50.0) };
    // All of them start at z = 0, and go along it.
    let [air, clear] = [lisa(&dusty), lisa(&rain(50.0))];
    let left = air.transmission(DVec3::ZERO, DVec3::X, 10.0);
    let of_rain = clear.transmission(DVec3::ZERO, DVec3::X, 10.0);
    let of_box = (-2.0 * 20f64.ln() / 5.0 * 3.0).exp();
    assert!((left / of_rain - of_box).abs() < 1e-12);
    let outside = DVec3::new(0.0, 1.5, 0.0);
    assert_eq!(air.transmission(outside, DVec3::X, 10.0), of_rain);
}

/// Koschmieder: 5 % of the light is left after the visibility, and a return passes twice. The dust
/// behind a return adds to it, up to the box's end.
#[test]
fn rain_is_seen_through_dust_and_dust_to_the_end_of_its_box() {
    let dust = Volume { min_m: [3.0, -5.0, -5.0], max_m: [6.0, 5.0, 5.0], visibility_m: 20.0 };
    let (clear, dusty) = (lisa(&rain(300.0)), Weather { volumes: vec![dust], ..rain(300.0) });
    let dusty = lisa(&dusty);
    let left = |range_m: f64| 0.05f64.powf(2.0 * (range_m.clamp(3.0, 6.0) - 3.0) / 20.0);
    let (mut n_rain, mut n_dust) = (0, 0);
    for number in 0..4000 {
        let beam = beam(40.0, number);
        let (dust, behind): (Vec<_>, Vec<_>) =
            scattered(&dusty, &beam).into_iter().partition(|one| one.medium == Medium::Dust);
        let expected = scattered(&clear, &beam);
        assert_eq!(behind.len(), expected.len());
        for (found, drop) in behind.iter().zip(&expected) {
            let share = left(drop.range_m);
            assert_eq!(found.range_m, drop.range_m);
            assert!((found.power / drop.power - share).abs() < 1e-12);
            assert!((found.brightness / drop.brightness - share).abs() < 1e-12);
            n_rain += usize::from(share < 0.5);
        }
        for one in dust {
            let rain_left = clear.transmission(DVec3::ZERO, DVec3::X, one.range_m);
            let own = fog::of_one_pulse(20.0, 6.0 - one.range_m);
            let expected = own * left(one.range_m) * rain_left;
            assert!((one.brightness - expected).abs() < 1e-12 * expected);
            n_dust += 1;
        }
    }
    assert!(n_rain > 30 && n_dust > 1000, "{n_rain} {n_dust}");
}

#[test]
fn dust_is_in_its_box_and_as_often_as_its_optical_depth_says() {
    let volume = Volume { min_m: [5.0, -1.0, -1.0], max_m: [8.0, 1.0, 1.0], visibility_m: 30.0 };
    let air = lisa(&Weather { volumes: vec![volume], ..Weather::default() });
    let depth = 3.0 * extinction_of(30.0);
    let through = air.transmission(DVec3::ZERO, DVec3::X, 20.0);
    assert!((through - (-2.0 * depth).exp()).abs() < 1e-12);
    assert!(air.transmission(DVec3::ZERO, DVec3::Y, 20.0) == 1.0, "beside the box");
    let all: Vec<_> = (0..20_000).flat_map(|i| scattered(&air, &beam(20.0, i))).collect();
    let expected = depth / 0.7;
    assert!((all.len() as f64 / 20_000.0 - expected).abs() < 4.0 * sigma(expected, 20_000));
    assert!(all.iter().all(|dust| (5.0..=8.0).contains(&dust.range_m)));
    // Two boxes return each by itself.
    let behind = Volume { min_m: [10.0, -1.0, -1.0], max_m: [13.0, 1.0, 1.0], ..volume };
    let two = lisa(&Weather { volumes: vec![volume, behind], ..Weather::default() });
    let both = (0..20_000).filter(|&i| scattered(&two, &beam(20.0, i)).len() == 2).count();
    let share = expected * expected;
    assert!((both as f64 / 20_000.0 - share).abs() < 4.0 * sigma(share, 20_000), "{both}");
    // The mean depth of an exponential law that ends after 3 m.
    let mean = all.iter().map(|dust| dust.range_m - 5.0).sum::<f64>() / all.len() as f64;
    let a = extinction_of(30.0);
    let law = 1.0 / a - 3.0 * (-3.0 * a).exp() / (1.0 - (-3.0 * a).exp());
    assert!((mean - law).abs() < 4.0 * 0.87 / (all.len() as f64).sqrt(), "{mean}, not {law}");
}

#[test]
fn weather_beyond_all_measure_stays_finite() {
    let extremes = [
        rain(1e6),
        rain(f64::MIN_POSITIVE),
        Weather { snow_mm_h: Some(1e6), ..Weather::default() },
        Weather { fog_visibility_m: Some(1e-3), ..Weather::default() },
        Weather { fog_visibility_m: Some(1e9), ..Weather::default() },
        Weather { haze_visibility_m: Some(1e-3), ..Weather::default() },
        Weather {
            rain_mm_h: Some(1e6),
            fog_visibility_m: Some(1e-3),
            volumes: vec![
                Volume { min_m: [0.0; 3], max_m: [0.0; 3], visibility_m: 1e-3 },
                Volume { min_m: [-1e9; 3], max_m: [1e9; 3], visibility_m: 1e-3 },
            ],
            ..Weather::default()
        },
    ];
    for weather in extremes {
        weather.validate().unwrap();
        let limits = [(1e-9, 1e9), (1.0, 1e-9), (0.9, 200.0)];
        for (reflectivity, range_m) in limits {
            for (min_m, max_m) in [(0.0, 1e9), (0.0, 1e-9), (1.5, 200.0)] {
                let limit = DetectionLimit { reflectivity, range_m };
                let range = RangeLimits { min_m, max_m, quantum_m: None };
                for divergence_deg in [[0.0; 2], [0.2, 0.1], [89.0; 2]] {
                    let air = Air::new(&weather, divergence_deg, &limit, &range);
                    for number in 0..50 {
                        for one in scattered(&air, &beam(max_m, number)) {
                            assert!(
                                one.range_m.is_finite() && (0.0..=max_m).contains(&one.range_m)
                            );
                            assert!(one.power >= 0.0 && !one.brightness.is_nan(), "{one:?}");
                        }
                    }
                    let through = air.transmission(DVec3::ZERO, DVec3::X, max_m);
                    assert!((0.0..=1.0).contains(&through), "{weather:?}: {through}");
                }
            }
        }
    }
}

#[test]
fn recorded_points_are_kept_weaker_or_moved_along_their_beams_or_lost() {
    let air = lisa(&rain(50.0));
    let limit = DetectionLimit { reflectivity: 0.9, range_m: 200.0 };
    let ray = |i: u32| DVec3::new(1.0, f64::from(i) * 1e-4, 0.2).normalize();
    let sensor_m = DVec3::new(1e4, 0.0, 2.0);
    let n = 20_000;
    let ranges: Vec<f64> = (0..n).map(|i| 5.0 + f64::from(i) * 0.005).collect();
    let mut positions: Vec<[f32; 3]> =
        (0..n).zip(&ranges).map(|(i, r)| (ray(i) * *r).as_vec3().to_array()).collect();
    (positions[7], positions[8]) = ([f32::NAN; 3], [0.0; 3]);
    let scan = formats::Scan {
        origin: sensor_m.to_array(),
        positions,
        beam: Some((0..n).collect()),
        range_m: Some(ranges.iter().map(|r| *r as f32).collect()),
        power: Some(vec![1.0; n as usize]),
        reflectivity: Some(vec![9; n as usize]),
        ..formats::Scan::default()
    };
    let brightness = vec![0.1; n as usize];
    let (found, fates) = in_weather(&scan, &brightness, sensor_m, &air, &limit, StreamKey([1, 2]));
    let Fates { kept, scattered, lost, passed_over, too_weak_before } = fates;
    assert_eq!((kept + scattered + lost + passed_over, passed_over), (n as usize, 2));
    assert!(kept > 1000 && scattered > 300 && lost > 1000, "{fates:?}");
    assert_eq!(found.len(), kept + scattered + passed_over);
    // They were those of clear air.
    assert_eq!((&found.power, &found.reflectivity), (&None, &None));
    // A surface of 10 % is detected in clear air up to a third of 200 m, as 90 % up to all of it.
    let left: std::collections::BTreeSet<u32> = found.beam.iter().flatten().copied().collect();
    let too_far = (0..n).filter(|i| ranges[*i as usize] > 200.0 / 3.0 && !left.contains(i));
    assert_eq!(too_weak_before, too_far.count());
    let (media, intensities) = (found.medium.as_ref().unwrap(), found.intensity.as_ref().unwrap());
    for (i, &beam) in found.beam.as_ref().unwrap().iter().enumerate() {
        let point = DVec3::from(found.positions[i].map(f64::from));
        if beam == 7 || beam == 8 {
            assert!(media[i] == 0 && intensities[i] == 0.1);
            continue;
        }
        assert!(point.normalize().dot(ray(beam)) > 1.0 - 1e-12, "along its beam");
        let range_m = f64::from(found.range_m.as_ref().unwrap()[i]);
        assert!((point.length() - range_m).abs() < 1e-5);
        if media[i] == Medium::Surface as u8 {
            let through = air.transmission(sensor_m, ray(beam), ranges[beam as usize]);
            assert!((f64::from(intensities[i]) - 0.1 * through).abs() < 1e-8);
        } else {
            assert!(media[i] == Medium::Rain as u8 && range_m < 12.0);
        }
    }
}
