//! Tests of the reader of URDF.

use super::*;
use formats::plausible::Warning;
use glam::DVec3;
use std::fs;

/// An arm in a plane: a turn about z, 2 m along x a turn about -z, 1 m along x a slide along x.
const ARM: &str = include_str!("arm.urdf");

fn read_at(text: &str, joints: &[(&str, f64)]) -> Result<Assembly, ParseError> {
    let joints = joints.iter().map(|(name, position)| ((*name).to_owned(), *position)).collect();
    parse(text, None, &Import { joints, ..Import::default() }, DAffine3::IDENTITY)
}

#[test]
fn links_stand_where_the_joints_put_them() {
    for (q, slide) in [(0.0, 0.0), (0.7, 0.25), (-0.4, 0.5)] {
        let robot = read_at(ARM, &[("shoulder", q), ("slide", slide)]).unwrap();
        let turned = |angle: f64| DVec3::new(angle.cos(), angle.sin(), 0.0);
        // By hand: the elbow turns back by half of the shoulder's angle and 0.1.
        let second = q - (0.5 * q + 0.1);
        let elbow = 2.0 * turned(q);
        let names = ["upper", "lower/round", "lower/2", "hand"];
        let places =
            [DVec3::ZERO, elbow + turned(second), elbow, elbow + (1.0 + slide) * turned(second)];
        for ((part, name), place) in robot.parts.iter().zip(names).zip(places) {
            assert_eq!(part.name, name);
            let found = part.world_from_mesh.translation;
            assert!(found.distance(place) < 1e-12, "{name}: {found} is not {place}");
        }
        // The cylinder's axis, z, lies along the link.
        let axis = robot.parts[1].world_from_mesh.transform_vector3(DVec3::Z);
        assert!(axis.distance(turned(second)) < 1e-12);
        assert_eq!(robot.parts[0].world_from_mesh.matrix3.x_axis.length(), 2.0);
        assert!(robot.warnings.is_empty(), "{:?}", robot.warnings);
        // The spheres are one mesh.
        assert_eq!((robot.parts[2].mesh, robot.meshes.len()), (robot.parts[3].mesh, 3));
    }
    let collision = Import { collision: true, ..Import::default() };
    let robot = parse(ARM, None, &collision, DAffine3::IDENTITY).unwrap();
    assert_eq!((robot.parts.len(), &robot.parts[0].name[..]), (1, "lower"));
}

/// The slide follows the elbow, which follows the shoulder: 0.4 (0.5 q + 0.1) + 0.3.
#[test]
fn a_joint_follows_one_that_follows_another() {
    let mimic = "<mimic joint=\"elbow\" multiplier=\"0.4\" offset=\"0.3\"/><limit lower=\"0\"";
    let robot = read_at(&ARM.replace("<limit lower=\"0\"", mimic), &[("shoulder", 0.2)]).unwrap();
    let [elbow, hand] = [2, 3].map(|part| robot.parts[part].world_from_mesh.translation);
    assert!((hand.distance(elbow) - (1.0 + 0.38)).abs() < 1e-12, "{elbow} {hand}");
}

#[test]
fn origins_turn_about_fixed_axes() {
    let text = r#"<robot><link name="a"><visual><origin rpy="0.1 -0.7 2"/><geometry><box size="1 1 1"/></geometry></visual></link></robot>"#;
    let found = read_at(text, &[]).unwrap().parts[0].world_from_mesh;
    let expected = DAffine3::from_rotation_z(2.0)
        * DAffine3::from_rotation_y(-0.7)
        * DAffine3::from_rotation_x(0.1);
    assert!(found.abs_diff_eq(expected, 1e-12));
}

#[test]
fn positions_out_of_limits_are_a_warning() {
    let warnings = read_at(ARM, &[("shoulder", 1.5), ("slide", 0.2)]).unwrap().warnings;
    let (name, limits) = ("shoulder".to_owned(), [-1.0, 1.0]);
    let expected = Warning::JointBeyondLimits { name, limits, found: 1.5 };
    assert_eq!(warnings, [expected]);
}

#[test]
fn meshes_are_found_beside_the_robot_and_in_packages() {
    let folder = tempfile::tempdir().unwrap();
    let package = folder.path().join("src/arm_description");
    fs::create_dir_all(package.join("urdf")).unwrap();
    fs::create_dir_all(package.join("meshes")).unwrap();
    fs::write(package.join("meshes/hand.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(package.join("meshes/bad.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 3\n").unwrap();
    let file = package.join("urdf/arm.urdf");
    let read = |name: &str| {
        let geometry =
            format!(r#"<geometry><mesh filename="{name}" scale="0.5 -1 1"/></geometry>"#);
        fs::write(
            &file,
            format!("<robot>\n<link name=\"a\">\n<visual>{geometry}</visual></link></robot>"),
        )
        .unwrap();
        load(&file, &Import::default(), DAffine3::IDENTITY).map_err(|error| error.to_string())
    };
    for name in ["../meshes/hand.obj", "package://arm_description/meshes/hand.obj"] {
        let robot = read(name).unwrap();
        let corner = robot.meshes[0].mesh.vertices[1];
        assert_eq!(
            robot.parts[0].world_from_mesh.transform_point3(corner),
            DVec3::new(0.5, 0.0, 0.0)
        );
    }
    fs::write(folder.path().join("empty.urdf"), "").unwrap();
    let empty = load(&folder.path().join("empty.urdf"), &Import::default(), DAffine3::IDENTITY);
    assert!(empty.unwrap_err().to_string().ends_with("empty.urdf: the file is empty"));
    for (name, expected) in [
        (
            "package://other/hand.obj",
            "arm.urdf:3: link \"a\": mesh \"package://other/hand.obj\": expected a folder other around",
        ),
        ("../meshes/hand.dae", "found Collada: convert it"),
        ("../meshes/bad.obj", "bad.obj:3: index 3 is out of range"),
        ("http://a/b.stl", "expected a path, package:// or file://, found http://"),
    ] {
        let error = read(name).unwrap_err();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn faults_are_named_with_their_lines() {
    for (swapped, expected) in test_support::said::faults(include_str!("faults.txt")) {
        let swapped = String::from_utf8(swapped).unwrap();
        let (from, to) = swapped.split_once(" | ").unwrap();
        let text = if from.is_empty() { to.to_owned() } else { ARM.replace(from, to) };
        assert_ne!(text, ARM, "{from}");
        let error = read_at(&text, &[]).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
    for (joint, position, expected) in [
        ("wrist", 0.0, "joint \"wrist\": expected one of shoulder, elbow, slide, found none"),
        ("elbow", 0.0, "joint \"elbow\": expected a joint that follows no other"),
        ("slide", f64::NAN, "joint \"slide\": expected a finite position"),
    ] {
        let error = read_at(ARM, &[(joint, position)]).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn tags_in_tags_without_end_are_an_error() {
    let deep = format!("<robot>{}{}</robot>", "<a>".repeat(200_000), "</a>".repeat(200_000));
    assert!(read_at(&deep, &[]).is_err());
}
