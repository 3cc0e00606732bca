use super::*;
use crate::sensor::DetectionLimit;

#[test]
fn no_effect_is_the_default_and_plain() {
    let effects: Effects = toml::from_str("").unwrap();
    assert!(effects.is_plain());
    let off: Effects = toml::from_str("intensity = false\nquantise_m = false").unwrap();
    assert!(off.is_plain());
}

#[test]
fn effects_survive_a_round_trip() {
    for text in [
        "",
        "noise = { sigma_m = 0.01 }",
        "noise = { mean_m = -0.5, sigma_m = 1000, model = \"xyz\" }",
        "dropout = { probability = 1 }\nquantise_m = true",
        "quantise_m = 0.004\nintensity = true",
        "detection = true",
        "detection = { threshold_to_noise = 5, range_sigma_m = 0.06 }",
        "detection = { reflectivity = 0.1, range_m = 60 }",
    ] {
        let effects: Effects = toml::from_str(text).unwrap();
        let json = serde_json::to_string(&effects).unwrap();
        assert_eq!(serde_json::from_str::<Effects>(&json).unwrap(), effects, "{json}");
    }
}

#[test]
fn bad_numbers_are_named() {
    for (text, key) in [
        ("noise = { sigma_m = -1e-9 }", "effects.noise.sigma_m"),
        ("noise = { sigma_m = inf }", "effects.noise.sigma_m"),
        ("noise = { sigma_m = 0, mean_m = nan }", "effects.noise.mean_m"),
        ("dropout = { probability = 1.01 }", "effects.dropout.probability"),
        ("dropout = { probability = nan }", "effects.dropout.probability"),
        ("quantise_m = 0.0", "effects.quantise_m"),
        ("quantise_m = -0.004", "effects.quantise_m"),
        ("quantise_m = \"4 mm\"", "quantise_m"),
        ("noise = { sigma = 0.1 }", "sigma"),
        ("fog = true", "fog"),
        ("detection = 0.1", "expected true for the sensor's own limit"),
        ("detection = { limit = 1 }", "expected true for the sensor's own limit"),
        (
            "detection = { range_m = 60 }",
            "effects.detection.reflectivity: expected a number beside",
        ),
        ("detection = { reflectivity = 0.1 }", "effects.detection.range_m"),
        ("detection = { reflectivity = 0, range_m = 60 }", "effects.detection.reflectivity"),
        ("detection = { reflectivity = 1.1, range_m = 60 }", "effects.detection.reflectivity"),
        ("detection = { reflectivity = 0.1, range_m = 1e10 }", "effects.detection.range_m"),
        ("detection = { threshold_to_noise = 0 }", "effects.detection.threshold_to_noise"),
        ("detection = { range_sigma_m = -1 }", "effects.detection.range_sigma_m"),
    ] {
        let error = toml::from_str::<Effects>(text).unwrap_err().to_string();
        assert!(error.contains(key), "{text}: {error}");
    }
}

#[test]
fn the_sensors_own_quantum_and_detection_limit_are_filled_in() {
    let [vlp32c, kinect] =
        ["vlp32c", "kinect-v2"].map(|name| SensorProfile::builtin(name).unwrap());
    let own: Effects = toml::from_str("quantise_m = true").unwrap();
    let resolved = own.for_sensor(&vlp32c).unwrap();
    assert_eq!(resolved.quantum, Some(Quantum { step_m: Some(0.004) }));
    let error = own.for_sensor(&kinect).unwrap_err();
    assert!(error.to_string().contains("kinect-v2"), "{error}");
    let own: Effects = toml::from_str("detection = true").unwrap();
    let limit = own.for_sensor(&vlp32c).unwrap().detection.unwrap().limit;
    assert_eq!(limit, Some(DetectionLimit { reflectivity: 0.8, range_m: 200.0 }));
    let error = own.for_sensor(&kinect).unwrap_err();
    assert!(error.to_string().contains("as sensor \"kinect-v2\" has no [detection]"), "{error}");
}
