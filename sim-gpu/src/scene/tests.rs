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
    for (text, part) in test_support::said::faults(include_str!("bad.txt")) {
        let text = String::from_utf8(text).unwrap();
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
