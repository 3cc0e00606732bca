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
fn misspelt_word_is_named_with_the_likely_one() {
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

/// Broken files, each with its whole message: one line for each mistake, and no other.
#[test]
fn all_mistakes_of_a_file_are_named_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("my.toml");
    for broken in include_str!("broken.txt").split("=====\n").skip(1) {
        let (text, expected) = broken.split_once("-----\n").unwrap();
        std::fs::write(&file, text).unwrap();
        let error = match text.starts_with("name") {
            true => SensorProfile::load(&file).unwrap_err(),
            false => SceneFile::load(&file).unwrap_err(),
        };
        let found = format!("{error}\n");
        assert_eq!(found.split_once("my.toml: ").unwrap().1, expected, "{text}");
    }
}

#[test]
fn broken_profile_is_named_once_and_indented() {
    let folder = tempfile::tempdir().unwrap();
    let profile = "name = 1\nsources = [2]\nrange = { max_m = 1 }\n";
    std::fs::write(folder.path().join("own.toml"), profile).unwrap();
    let sensor = "[[sensor]]\nprofile = \"own.toml\"\nposition_m = [1, 0, 0]\nyaw_deg = 0\n";
    let text = format!("seed = 1\n{OBJECT}yaw_deg = nan\n{sensor}{sensor}");
    let error = SceneFile::parse(&text, &folder.path().join("my.toml")).unwrap_err().to_string();
    let found = error.replace(&format!("{}/", folder.path().display()), "");
    let expected = "my.toml: 2 mistakes:\n  \
                    line 4: object[0].yaw_deg: expected a finite number, found NaN\n  \
                    line 6: sensor[0].profile: own.toml: 2 mistakes:\n      \
                    line 1: name: expected a string, found 1\n      \
                    line 2: sources[0]: expected a string, found 2";
    assert_eq!(found, expected);
}
