use super::*;
use crate::effects::{Intensity, Noise, NoiseModel, Quantum};

fn shipped(name: &str) -> SceneFile {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/scenes");
    SceneFile::load(&folder.join(name)).unwrap()
}

const OBJECT: &str = "[[object]]\nmesh = \"a.obj\"\n";
const SENSOR: &str = "[[sensor]]\nprofile = \"vlp16\"\nposition_m = [1, 0, 0]\nyaw_deg = 0\n";

fn parse(text: &str) -> Result<SceneFile, ConfigError> {
    SceneFile::parse(text, Path::new("scenes/my.toml"))
}

#[test]
fn the_plain_scene_wants_nothing() {
    let scene = shipped("plain.toml");
    assert!(scene.effects.is_plain());
    assert!(scene.attributes.is_empty());
    assert_eq!((scene.objects.len(), scene.sensors.len()), (1, 1));
}

#[test]
fn the_two_chairs_show_every_effect() {
    let scene = shipped("two_chairs.toml");
    assert_eq!(scene.seed, 7);
    let noise = Noise { mean_m: 0.0, sigma_m: 0.01, model: NoiseModel::Range };
    assert_eq!(scene.effects.noise, Some(noise));
    assert_eq!(scene.effects.dropout.map(|dropout| dropout.probability), Some(0.05));
    assert_eq!(scene.effects.quantum, Some(Quantum { step_m: None }));
    assert_eq!(scene.effects.intensity, Some(Intensity));
    let [near, far] = scene.objects.as_slice() else { panic!("two chairs") };
    assert_eq!((near.name.as_str(), far.name.as_str()), ("near_chair", "far_chair"));
    assert!(near.mesh.ends_with("assets/scenes/../meshes/chair/chair_0046.obj"), "{:?}", near.mesh);
    assert_eq!(far.scale, DVec3::new(1.1, 1.0, 1.2));
    assert_eq!(scene.sensors[0].name, "roof");
    assert_eq!(scene.sensors[0].sensor.name, "vlp32c");
}

#[test]
fn an_object_stands_upright_at_the_origin_by_default() {
    let scene = parse(&format!("{OBJECT}{SENSOR}")).unwrap();
    let object = &scene.objects[0];
    assert_eq!(object.mesh, Path::new("scenes/a.obj"));
    assert_eq!(object.name, "a");
    assert_eq!(object.reflectivity, 1.0);
    assert_eq!(object.world_from_object(), DAffine3::IDENTITY);
}

#[test]
fn an_object_is_simplified_as_it_says_or_else_as_the_scene_says() {
    let simplify = |scene: &str, object: &str| {
        let scene = parse(&format!("{scene}\n{OBJECT}{object}\n{SENSOR}")).unwrap();
        scene.simplify_of(&scene.objects[0])
    };
    assert_eq!(simplify("", ""), None);
    assert_eq!(simplify("simplify = \"auto\"", ""), Some(Simplify::Auto));
    assert_eq!(simplify("simplify = \"auto\"", "simplify = false"), None);
    assert_eq!(simplify("simplify = 1", "simplify = 0.002"), Some(Simplify::Metres(0.002)));
    assert_eq!(simplify("", "simplify = \"auto\""), Some(Simplify::Auto));
}

#[test]
fn an_object_is_scaled_then_turned_then_moved() {
    let keys = "position_m = [0, 0, 5]\nyaw_deg = 90\nscale = 2";
    let scene = parse(&format!("{OBJECT}{keys}\n{SENSOR}")).unwrap();
    let moved = scene.objects[0].world_from_object().transform_point3(DVec3::X);
    assert!(moved.abs_diff_eq(DVec3::new(0.0, 2.0, 5.0), 1e-15), "{moved}");
}

#[test]
fn bad_scenes_are_named() {
    let object = |keys: &str| format!("{OBJECT}{keys}\n{SENSOR}");
    let sensor = |keys: &str| format!("{OBJECT}[[sensor]]\n{keys}\n");
    let both = |keys: &str| format!("{keys}\n{OBJECT}{SENSOR}");
    for (text, part) in [
        (String::new(), "expected at least one [[object]]"),
        (OBJECT.to_owned(), "expected at least one [[sensor]]"),
        (SENSOR.to_owned(), "expected at least one [[object]]"),
        (format!("{OBJECT}{OBJECT}{SENSOR}"), "object[1].name: \"a\" is the name of object[0] too"),
        (format!("{OBJECT}{SENSOR}{SENSOR}"), "sensor[1].name: \"vlp16\" is the name of"),
        (object("colour = 1"), "colour"),
        (object("scale = 0"), "object[0].scale"),
        (object("scale = [1, -1, 1]"), "object[0].scale"),
        (object("scale = [1, 1]"), "as scale"),
        (object("reflectivity = 1.5"), "object[0].reflectivity"),
        (object("reflectivity = nan"), "object[0].reflectivity"),
        (object("retroreflection = 2"), "object[0].retroreflection"),
        (object("materials = { a = 0.5 }"), "expected the name of a built-in material"),
        (object("materials = { a = \"paint\" }"), "object[0].materials.a: expected one of asphalt"),
        (
            object("materials = { a = { reflectivity = -1 } }"),
            "object[0].materials.a.reflectivity: expected a number within 0..=1",
        ),
        (
            object("colours = \"mtl\"\nsimplify = \"auto\""),
            "object[0].materials: a simplified mesh",
        ),
        (both("effects = { detection = { range_m = 5 } }"), "effects.detection.reflectivity"),
        (object("up = \"x\""), "object[0].up: expected one of"),
        (object("normalize = \"sphere\""), "object[0].normalize: expected one of"),
        (object("position_m = [0, 0, inf]"), "object[0].position_m"),
        (object("name = \" \""), "object[0].name: expected a name"),
        (object("yaw_deg = 1\nquaternion_xyzw = [0, 0, 0, 1]"), "found several of them"),
        (format!("[[object]]\nmesh = \"\"\n{SENSOR}"), "object[0].mesh: expected the path"),
        (
            sensor("profile = \"vlp23\"\nposition_m = [0, 0, 0]\nyaw_deg = 0"),
            "sensor[0].profile: expected the path of a TOML profile or one of",
        ),
        (sensor("profile = \"vlp16\"\nposition_m = [0, 0, 0]"), "sensor[0]: expected look_at_m"),
        (sensor("profile = \"./none.toml\"\nposition_m = [0, 0, 0]"), "scenes/./none.toml"),
        (sensor("position_m = [0, 0, 0]"), "profile"),
        (both("seed = -1"), "seed"),
        (both("attributes = [\"range\", \"colour\"]"), "attributes[1]"),
        (both("attributes = [\"range\", \"range\"]"), "attributes[1]: found \"range\""),
        (both("attributes = [\"intensity\"]"), "requires effects.intensity"),
        (both("simplify = 0"), "simplify: expected a number above 0, found 0"),
        (both("simplify = \"much\""), "simplify: expected \"auto\" or a number of metres"),
        (both("simplify = false"), "as simplify"),
        (object("simplify = true"), "object[0].simplify: expected"),
        (object("simplify = -1"), "as simplify"),
        (both("simplify = \"auto\"\nattributes = [\"triangle\"]"), "simplify: a simplified mesh"),
        (both("effects = { fog = true }"), "fog"),
        (both("effects = { dropout = { probability = 2 } }"), "effects.dropout.probability"),
        (
            format!(
                "{OBJECT}[[sensor]]\nprofile = \"kinect-v2\"\nposition_m = [1, 0, 0]\n\
                     yaw_deg = 0\n[effects]\nquantise_m = true"
            ),
            "has no range.quantum_m",
        ),
        ("seed = \n".to_owned(), "line 1"),
    ] {
        let error = parse(&text).unwrap_err().to_string();
        assert!(error.contains(part), "{text}\n-> {error}");
        assert!(error.contains("my.toml") || error.contains("none.toml"), "{error}");
    }
}

/// The blocks of TOML in a page.
fn snippets(page: &str) -> impl Iterator<Item = &str> {
    page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next())
}

#[test]
fn the_scenes_of_effects_md_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["ego.tum", "car.tum"] {
        let poses = "1699999999 0 0 0 0 0 0 1\n1700000001 5 0 0 0 0 0 1\n";
        std::fs::write(folder.path().join(file), poses).unwrap();
    }
    let page = include_str!("../../EFFECTS.md");
    assert!(snippets(page).count() >= 2);
    for snippet in snippets(page) {
        let missing = |table, text| if snippet.contains(table) { "" } else { text };
        let (object, sensor) = (missing("[[object]]", OBJECT), missing("[[sensor]]", SENSOR));
        let text = format!("{object}{sensor}{snippet}");
        let scene = SceneFile::parse(&text, &folder.path().join("scene.toml"));
        scene.unwrap_or_else(|error| panic!("{error}\n{snippet}"));
    }
    // The poses in its prose have no orientation: they look along x.
    let poses =
        page.split("`trajectory = ").nth(1).and_then(|rest| rest.split('`').next()).unwrap();
    let moving = format!("{OBJECT}trajectory = {poses}\n{SENSOR}");
    let scene = parse(&moving).unwrap();
    let pose = scene.objects[0].motion.as_ref().unwrap().at(0.5);
    assert_eq!(pose.position_m, DVec3::new(2.5, 0.0, 1.0));
    // Half of the 10 degrees.
    assert!(pose.rotation.angle_between(DQuat::from_rotation_z(5f64.to_radians())) < 1e-12);
}

#[test]
fn a_misspelt_word_is_told_with_the_likely_one() {
    for (wrong, meant) in [
        ("[effects]\nnois = { sigma_m = 0.1 }\n", "did you mean \"noise\"?"),
        ("[[object]]\nmesh = \"a.obj\"\nreflectivty = 0.5\n", "did you mean \"reflectivity\"?"),
    ] {
        let error = parse(&format!("{OBJECT}{SENSOR}{wrong}")).unwrap_err().to_string();
        assert!(error.contains(meant), "{error}");
    }
    let error = parse(&format!("{OBJECT}{}", SENSOR.replace("vlp16", "vlp61"))).unwrap_err();
    assert!(error.to_string().contains("did you mean \"vlp16\"?"), "{error}");
    let far = parse(&format!("{OBJECT}{SENSOR}[effects]\nxyz = 1\n")).unwrap_err().to_string();
    assert!(!far.contains("did you mean"), "{far}");
}

/// A broken file, and all that is wrong with it.
const BROKEN: [(&str, &str); 7] = [
    (
        r#"seed = "one"
attributes = ["rnage", "ring", "ring"]

[[object]]
mesh = "a.obj"
reflectivty = 0.5
position_m = [0, "left", 0]

[[object]]
name = "b"
scale = [1, 0, 1]
yaw_deg = nan

[[sensor]]
profile = "vlp61"

[[sensor]]
profile = "vlp16"
position_m = [1, 0, 0]
yaw = 3

[effects]
dropout = { probability = 2 }
noise = { sigma_m = -1, modle = "xyz" }
"#,
        r#"line 1: seed: expected a whole number within 0..=18446744073709551615, found "one"
line 2: attributes[0]: expected one of range, beam, ring, time, triangle, object, intensity, power, reflectivity, return, medium, sensor, attitude, normal, found "rnage"; did you mean "range"?
line 2: attributes[2]: found "ring" in the list twice
line 6: object[0].reflectivty: expected one of
line 7: object[0].position_m[1]: expected a number, found "left"
line 9: object[1].mesh: expected a value, found none
line 11: object[1].scale: expected a number above 0, found 0
line 12: object[1].yaw_deg: expected a finite number, found NaN
line 15: sensor[0].profile: expected the path of a TOML profile or one of
line 20: sensor[1].yaw: expected one of profile, name, position_m, look_at_m, yaw_deg, pitch_deg, roll_deg, quaternion_xyzw, trajectory, revolutions, start_s, deskew, found "yaw"; did you mean "yaw_deg"?
line 23: effects.dropout.probability: expected a number within 0..=1, found 2
line 24: effects.noise.modle: expected one of mean_m, sigma_m, model, found "modle"; did you mean
line 24: effects.noise.sigma_m: expected a number within 0..=1000000000, found -1"#,
    ),
    // Consequences of a mistake are not told: here, that rpm is missing, and of what is missing.
    (
        "name = \"own\"\n[range]\nmin_m = 5\n[rotating]\nrmp = 600\n[[rotating.beam]]\n\
         azimuth_offset_deg = 0\nelevation_deg = 95\nfiring_us = 100\n",
        "line 2: range.max_m: expected a value, found none\n\
         line 4: rotating.sequence_us: expected a value, found none\n\
         line 5: rotating.rmp: expected one of rpm, \n\
         line 8: rotating.beam[0].elevation_deg: expected a number within -90..=90, found 95",
    ),
    (
        "name = 1\nsources = [2]\nrange = { max_m = -1, min_m = true }\n[views]\ncount = -3\n\
         [rings]\nstep_deg = 0\n",
        "rotating: expected one of [rotating], [uniform], [grid], [risley] and [table], found none\n\
         line 1: name: expected a string, found 1\n\
         line 2: sources[0]: expected a string, found 2\n\
         line 3: range.min_m: expected a number, found true\n\
         line 3: range.max_m: expected a number above 0, found -1\n\
         line 4: views.distance_m: expected a value, found none\n\
         line 4: views.elevation_deg: expected a value, found none\n\
         line 4: views.azimuth_deg: expected a value, found none\n\
         line 5: views.count: expected a whole number within 0..=4294967295, found -3\n\
         line 6: rings.keep_from: expected a value, found none\n\
         line 6: rings.keep_to: expected a value, found none\n\
         line 7: rings.step_deg: expected a number above 0, found 0",
    ),
    (
        "[object]\nmesh = \"a.obj\"\n[sensor]\nprofile = \"vlp16\"\n",
        "line 1: object: expected a list, found [object]\n\
         line 3: sensor: expected a list, found [sensor]",
    ),
    ("name = \n\n[range\nmax_m = 1\n", "line 1: string values must be quoted\nline 3: "),
    (
        "[[object]]\nmesh = \"a.obj\"\n[[sensor]]\nprofile = \"vlp16\"\nposition_m = [1, 0, 0]\n\
         yaw_deg = 0\n[[sensor]]\nname = \"front\"\nprofile = \"kinect-v2\"\n\
         position_m = [1, 0, 0]\nyaw_deg = 0\n[effects]\ndetection = true\nquantise_m = true\n",
        "line 13: effects.detection: expected reflectivity and range_m, as sensor \"kinect-v2\" has no \
         [detection]: sensor[1], \"front\"\n\
         line 14: effects.quantise_m: expected metres, as sensor \"kinect-v2\" has no range.quantum_m",
    ),
    (
        "[[sensor]]\n[[object]]\n",
        "line 1: sensor[0].profile: expected a value, found none\nline 2: object[0].mesh: expected a value, found none",
    ),
];

#[test]
fn all_mistakes_of_a_file_are_told_at_once() {
    for (text, expected) in BROKEN {
        let error = if text.starts_with("name") {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("my.toml");
            std::fs::write(&file, text).unwrap();
            SensorProfile::load(&file).unwrap_err().to_string()
        } else {
            parse(text).unwrap_err().to_string()
        };
        let (_, told) = error.split_once("my.toml: ").unwrap();
        let told: Vec<&str> =
            told.lines().filter(|line| !line.ends_with("mistakes:")).map(str::trim).collect();
        let expected: Vec<&str> = expected.lines().collect();
        assert_eq!(told.len(), expected.len(), "{text}\n-> {error}");
        for (told, expected) in told.into_iter().zip(expected) {
            assert!(told.starts_with(expected), "{told}\nis not\n{expected}\n{error}");
        }
    }
}
