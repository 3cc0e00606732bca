//! Tests of the reader of glTF.

use super::*;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DMat3, DQuat};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// A GLB file of these parts.
fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], by: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), by);
        bytes
    };
    let (json, buffer) = (padded(json.as_bytes(), b' '), padded(buffer, 0));
    let size = (12 + 8 + json.len() + 8 + buffer.len()) as u32;
    let mut bytes = [b"glTF".as_slice(), &2u32.to_le_bytes(), &size.to_le_bytes()].concat();
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", buffer)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// The corners (0, 0, 0), (1, 0, 0), (0, 1, 0) and (1, 1, 0), then the indices 0, 1, 2, 3.
fn buffer() -> Vec<u8> {
    let corners = [[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    bytes
}

fn json(nodes: &str, mode: u32, n_indices: usize) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "mode": {mode}}}]}}],
        "accessors": [
          {{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
            "min": [0, 0, 0], "max": [1, 1, 0]}},
          {{"bufferView": 1, "componentType": 5123, "count": {n_indices}, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteOffset": 0, "byteLength": 48}},
                        {{"buffer": 0, "byteOffset": 48, "byteLength": 8}}],
        "buffers": [{{"byteLength": 56}}]}}"#
    )
}

const NODE: &str = r#"{"mesh": 0}"#;

#[test]
fn nodes_stand_where_those_above_put_them() {
    // Moved by (10, 0, 0), then turned by a quarter about z and scaled by 2.
    let nodes = r#"{"translation": [10, 0, 0], "children": [1]},
        {"rotation": [0, 0, 0.7071067811865476, 0.7071067811865476], "scale": [2, 2, 2], "mesh": 0}"#;
    let parsed = parse(&glb(&json(nodes, 4, 3), &buffer()), None).unwrap();
    let expected = [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [8.0, 0.0, 0.0], [8.0, 2.0, 0.0]];
    for (found, expected) in parsed.mesh.vertices.iter().zip(expected) {
        assert!((*found - DVec3::from_array(expected)).length() < 1e-6, "{found}");
    }
    assert_eq!(parsed.mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn an_instance_is_the_same_mesh_again_and_strips_and_fans_are_triangles() {
    let twice = r#"{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0, "translation": [0, 0, 5]}"#;
    let parsed = parse(&glb(&json(twice, 4, 3), &buffer()), None).unwrap();
    assert_eq!((parsed.mesh.vertices.len(), parsed.mesh.triangles.len()), (8, 2));
    for (mode, expected) in [(5, [[0, 1, 2], [1, 3, 2]]), (6, [[0, 1, 2], [0, 2, 3]])] {
        let parsed = parse(&glb(&json(NODE, mode, 4), &buffer()), None).unwrap();
        assert_eq!(parsed.mesh.triangles, expected);
    }
    let mirrored = r#"{"mesh": 0, "scale": [-1, 1, 1]}"#;
    let parsed = parse(&glb(&json(mirrored, 4, 3), &buffer()), None).unwrap();
    assert_eq!(parsed.mesh.triangles, [[0, 2, 1]]);
}

#[test]
fn buffers_may_be_in_base64_or_beside_the_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a b\u{f6}.bin"), buffer()).unwrap();
    let inline = format!("data:application/octet-stream;base64,{}", STANDARD.encode(buffer()));
    for uri in ["a%20b%C3%B6.bin", &inline] {
        let text = json(NODE, 4, 3)
            .replace(r#""byteLength": 56"#, &format!(r#""byteLength": 56, "uri": "{uri}""#));
        let parsed = parse(text.as_bytes(), Some(folder.path())).unwrap();
        assert_eq!(parsed.mesh.triangles, [[0, 1, 2]]);
    }
}

#[test]
fn what_is_wrong_is_named_with_its_place() {
    let good = json(NODE, 4, 3);
    let swap = |from: &str, to: &str| {
        let changed = good.replace(from, to);
        assert_ne!(changed, good);
        glb(&changed, &buffer())
    };
    for (bytes, expected) in [
        (b"{}".to_vec(), "expected glTF 2.0: "),
        (b"glTF\x02\0\0\0\x0b\0\0\0".to_vec(), "expected a length of 12 or more in the header"),
        (swap(r#""scenes": [{"nodes": [0]}]"#, r#""scenes": []"#), "scene"),
        (swap(r#""mesh": 0"#, r#""mesh": 7"#), "nodes[0].mesh"),
        (
            swap(
                r#""bufferView": 0, "#,
                r#""bufferView": 0, "byteOffset": 18446744073709551604, "#,
            ),
            "accessors[0]: expected 4 elements",
        ),
        (swap("5123", "5126"), "expected indices of whole numbers without sign"),
        (
            swap(r#""count": 3"#, r#""count": 99"#),
            "meshes[0].primitives[0]: accessors[1]: expected 99 elements",
        ),
        (
            swap(r#""byteOffset": 48, "byteLength": 8"#, r#""byteOffset": 48, "byteLength": 80"#),
            "accessors[1]: its buffer view ends after the buffer",
        ),
        (
            swap(r#"[{"byteLength": 56}]"#, r#"[{"byteLength": 560}]"#),
            "buffers[0]: expected 560 bytes",
        ),
        (
            swap(r#""asset""#, r#""extensionsRequired": ["KHR_draco_mesh_compression"], "asset""#),
            "expected a file without KHR_draco_mesh_compression",
        ),
        (
            swap(r#""asset""#, r#""extensionsRequired": ["ACME_geo"], "asset""#),
            "expected a file without ACME_geo: export it without",
        ),
        (
            swap(r#"{"version": "2.0"}"#, r#"{"version": "2.0", "minVersion": "2.1"}"#),
            "asset.minVersion: expected at most 2.0, found 2.1: export it as glTF 2.0",
        ),
        (glb(&good, &buffer())[..99].to_vec(), "the file ends after 99 of 700 bytes"),
        (b"glTF\x02\0\0\0".to_vec(), "the file ends after 8 of 12 bytes"),
        (
            glb(&json(NODE, 1, 4), &buffer()),
            "expected at least one triangle, found only points or lines",
        ),
        (
            swap(r#""nodes": [{"mesh": 0}]"#, r#""nodes": [{}]"#),
            "expected at least one triangle, found only meshes that are empty or in no node of the scene",
        ),
        (
            glb(&good, &[&f32::NAN.to_le_bytes(), &buffer()[4..]].concat()),
            "meshes[0]: vertex 1 of 4: expected finite coordinates, found ",
        ),
        (
            glb(&json(r#"{"mesh": 0, "children": [0]}"#, 4, 3), &buffer()),
            "nodes[0]: expected one parent",
        ),
        (
            glb(&good, &[[0; 48].as_slice(), &[9; 8]].concat()),
            "expected indices of 4 vertices, found 2313",
        ),
    ] {
        let error = parse(&bytes, None).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn what_reading_does_not_need_may_be_missing_or_unknown() {
    let good = json(NODE, 4, 3);
    let read = |from: &str, to: &str| {
        let changed = good.replace(from, to);
        assert_ne!(changed, good);
        parse(&glb(&changed, &buffer()), None).unwrap()
    };
    let expected = parse(&glb(&good, &buffer()), None).unwrap();
    assert_eq!(read(r#""min": [0, 0, 0], "max": [1, 1, 0]"#, r#""name": "a""#), expected);
    let required = r#""extensionsRequired": ["KHR_materials_unlit"], "asset""#;
    assert_eq!(read(r#""asset""#, required), expected);
    // The last vertex is of no triangle.
    let bytes = [&buffer()[..36], &f32::NAN.to_le_bytes(), &buffer()[40..]].concat();
    assert_eq!(parse(&glb(&good, &bytes), None).unwrap().mesh.vertices[3], DVec3::ZERO);
}

/// What animates a node: its number, the path, the interpolation, times and values.
type Moved<'a> = (usize, &'a str, &'a str, &'a [f32], &'a [&'a [f32]]);

/// A file of these nodes, whose mesh 0 is one triangle, and animations of one channel each.
fn animated(nodes: &str, channels: &[Moved]) -> Vec<u8> {
    let mut bytes = buffer();
    let mut add = |numbers: &[f32]| {
        let at = bytes.len();
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        format!(r#"{{"buffer": 0, "byteOffset": {at}, "byteLength": {}}}"#, 4 * numbers.len())
    };
    let (mut views, mut accessors, mut animations) = (vec![], vec![], vec![]);
    for (i, (node, path, interpolation, times, values)) in channels.iter().enumerate() {
        views.extend([add(times), add(&values.concat())]);
        let (at, kind) = (2 + 2 * i, if *path == "rotation" { "VEC4" } else { "VEC3" });
        for (view, n, kind) in [(at, times.len(), "SCALAR"), (at + 1, values.len(), kind)] {
            accessors.push(format!(
                r#"{{"bufferView": {view}, "componentType": 5126, "count": {n}, "type": "{kind}"}}"#
            ));
        }
        animations.push(format!(
            r#"{{"channels": [{{"sampler": 0, "target": {{"node": {node}, "path": "{path}"}}}}],
              "samplers": [{{"input": {at}, "output": {}, "interpolation": "{interpolation}"}}]}}"#,
            at + 1
        ));
    }
    let text = json(nodes, 4, 3)
        .replace(
            r#""type": "SCALAR"}]"#,
            &format!(r#""type": "SCALAR"}}, {}]"#, accessors.join(", ")),
        )
        .replace(r#""byteLength": 8}]"#, &format!(r#""byteLength": 8}}, {}]"#, views.join(", ")))
        .replace(r#"{"byteLength": 56}"#, &format!(r#"{{"byteLength": {}}}"#, bytes.len()))
        .replace(
            r#""buffers""#,
            &format!(r#""animations": [{}], "buffers""#, animations.join(", ")),
        );
    glb(&text, &bytes)
}

/// From the mesh of the only part to the world, at a time.
fn place(bytes: &[u8]) -> impl Fn(f64) -> DAffine3 + use<> {
    let Part { world_from_mesh, motion, .. } =
        assemble(bytes, None, DAffine3::IDENTITY).unwrap().parts.remove(0);
    let motion = motion.unwrap();
    move |time_s| {
        let at = motion.at(time_s);
        DAffine3::from_rotation_translation(at.rotation, at.position_m) * world_from_mesh
    }
}

/// Turns about y by quarters in [1, 2] and [2, 3] s.
const QUARTERS: &[&[f32]] = &[
    &[0.0, 0.0, 0.0, 1.0],
    &[0.0, std::f32::consts::FRAC_1_SQRT_2, 0.0, std::f32::consts::FRAC_1_SQRT_2],
    &[0.0, 1.0, 0.0, 0.0],
];

#[test]
fn lines_and_arcs_of_one_node_are_exact() {
    let nodes = r#"{"translation": [0, 0, 7], "rotation": [0, 0, 0.70710678, 0.70710678], "children": [1]},
        {"scale": [2, 3, 4], "children": [2]}, {"translation": [1, 0, 0], "mesh": 0}"#;
    let along: &[&[f32]] = &[&[0.0, 0.0, 0.0], &[0.0, 0.0, 10.0]];
    let file = animated(
        nodes,
        &[
            (1, "rotation", "LINEAR", &[1.0, 2.0, 3.0], QUARTERS),
            (1, "translation", "LINEAR", &[0.0, 4.0], along),
        ],
    );
    let place = place(&file);
    for i in 0..20 {
        let time_s = 0.25 * f64::from(i) - 0.5;
        let (turn, way) = ((time_s - 1.0).clamp(0.0, 2.0), time_s.clamp(0.0, 4.0));
        let above = DAffine3::from_translation(DVec3::new(0.0, 0.0, 7.0))
            * DAffine3::from_rotation_z(FRAC_PI_2);
        let own = DAffine3::from_rotation_y(turn * FRAC_PI_2)
            * DAffine3::from_scale(DVec3::new(2.0, 3.0, 4.0));
        let expected = above
            * DAffine3::from_translation(DVec3::new(0.0, 0.0, 2.5 * way))
            * own
            * DAffine3::from_translation(DVec3::X);
        // The file's numbers are f32.
        assert!(place(time_s).abs_diff_eq(expected, 2e-6), "{time_s}: {}", place(time_s));
    }
}

#[test]
fn steps_are_exact_at_every_time() {
    let places: &[&[f32]] = &[&[1.0, 0.0, 0.0], &[2.0, 0.0, 0.0], &[4.0, 0.0, 0.0]];
    let place = place(&animated(NODE, &[(0, "translation", "STEP", &[0.0, 0.5, 1.5], places)]));
    for (time_s, x) in [
        (-1.0, 1.0),
        (0.5f64.next_down(), 1.0),
        (0.5, 2.0),
        (1.2, 2.0),
        (1.5f64.next_down(), 2.0),
        (9.0, 4.0),
    ] {
        assert_eq!(place(time_s).translation, DVec3::new(x, 0.0, 0.0), "{time_s}");
    }
}

#[test]
fn splines_and_composed_motion_are_within_the_bound() {
    // An in-tangent, a value and an out-tangent for each key.
    let spline: &[&[f32]] =
        &[&[0.0; 3], &[0.0; 3], &[6.0, 0.0, 0.0], &[0.0, -9.0, 0.0], &[1.0, 2.0, 0.0], &[0.0; 3]];
    let curve = place(&animated(NODE, &[(0, "translation", "CUBICSPLINE", &[1.0, 3.0], spline)]));
    // A key before them, another after them.
    let beside: &[&[f32]] = &[&[7.0; 3], &[7.0; 3], &[7.0; 3]];
    let around = [beside, spline, beside].concat();
    let times_s = &[0.0, 1.0, 3.0, 5.0];
    let longer = place(&animated(NODE, &[(0, "translation", "CUBICSPLINE", times_s, &around)]));
    // A mirror above a turn: node 0 turns, node 1 goes up and turns on it, with the mesh 5 m beside.
    let nodes = r#"{"scale": [-2, 2, 2], "children": [1]}, {"children": [2]},
        {"children": [3]}, {"translation": [5, 0, 0], "mesh": 0}"#;
    let up: &[&[f32]] = &[&[0.0; 3], &[0.0, 0.0, 8.0]];
    let file = animated(
        nodes,
        &[
            (1, "rotation", "LINEAR", &[1.0, 2.0, 3.0], QUARTERS),
            (2, "translation", "LINEAR", &[1.0, 3.0], up),
            (2, "rotation", "LINEAR", &[1.0, 2.0, 3.0], QUARTERS),
        ],
    );
    let composed = place(&file);
    for i in 0..=200 {
        let time_s = 1.0 + 0.01 * f64::from(i);
        let s = 0.5 * (time_s - 1.0);
        // Hermite's polynomials; tangents are per second, of a span of 2 s.
        let expected = DVec3::new(
            12.0 * (s.powi(3) - 2.0 * s * s + s) + 3.0 * s * s - 2.0 * s.powi(3),
            -18.0 * (s.powi(3) - s * s) + 2.0 * (3.0 * s * s - 2.0 * s.powi(3)),
            0.0,
        );
        let found = curve(time_s).translation;
        assert!(found.distance(expected) < 1.01e-4, "{time_s}: {found} is not {expected}");
        assert!(longer(time_s).translation.distance(expected) < 1.01e-4, "{time_s}");
        let turn = DAffine3::from_rotation_y((time_s - 1.0) * FRAC_PI_2);
        let expected = DAffine3::from_scale(DVec3::new(-2.0, 2.0, 2.0))
            * turn
            * DAffine3::from_translation(DVec3::new(0.0, 0.0, 4.0 * (time_s - 1.0)))
            * turn
            * DAffine3::from_translation(DVec3::new(5.0, 0.0, 0.0));
        // The bound of positions, and that of rotations 10 m away.
        assert!(composed(time_s).abs_diff_eq(expected, 1.1e-3), "{time_s}");
    }
    assert!(DMat3::from_mat4(composed(1.0).into()).determinant() < 0.0);
}

#[test]
fn a_turn_by_half_goes_the_way_of_the_file_s_quaternions() {
    let half: &[&[f32]] = &[&[0.0, 0.0, 0.0, 1.0], &[0.0, 1.0, 0.0, 1e-9]];
    let nodes = r#"{"rotation": [0.1, 0.2, 0.3, 0.9], "children": [1]}, {"mesh": 0}"#;
    let place = place(&animated(nodes, &[(1, "rotation", "LINEAR", &[0.0, 1.0], half)]));
    let above = DQuat::from_xyzw(0.1, 0.2, 0.3, 0.9).normalize();
    let expected = DAffine3::from_quat(above * DQuat::from_rotation_y(FRAC_PI_4));
    assert!(place(0.25).abs_diff_eq(expected, 1e-6));
}

#[test]
fn parts_have_names_and_share_meshes() {
    let nodes = r#"{"name": "left", "mesh": 0, "children": [1]}, {"mesh": 0, "scale": [-1, 1, 1]}"#;
    let still: &[&[f32]] = &[&[3.0, 0.0, 0.0], &[3.0, 0.0, 0.0], &[3.0, 0.0, 0.0]];
    let file = animated(nodes, &[(0, "translation", "LINEAR", &[0.0, 1.0, 2.0], still)]);
    let Assembly { meshes, parts, .. } = assemble(&file, None, DAffine3::IDENTITY).unwrap();
    assert_eq!((meshes.len(), parts.len()), (1, 2));
    assert_eq!([&parts[0].name, &parts[1].name], ["left", "nodes[1]"]);
    assert!(parts.iter().all(|part| part.motion.is_none()));
    assert_eq!(parts[0].world_from_mesh.translation, DVec3::new(3.0, 0.0, 0.0));
    // As a mesh, the nodes stand at rest.
    let parsed = parse(&file, None).unwrap();
    assert_eq!(parsed.mesh.vertices[0], DVec3::ZERO);
    assert_eq!(parsed.mesh.triangles, [[0, 1, 2], [4, 6, 5]]);
}

#[test]
fn wrong_animation_is_named_with_its_place() {
    let two: &[f32] = &[0.0, 1.0];
    let moved: &[&[f32]] = &[&[0.0; 3], &[1.0, 2.0, 3.0]];
    let one = |node, path, kind, times: &[f32], values: &[&[f32]]| {
        animated(NODE, &[(node, path, kind, times, values)])
    };
    let below = |above: &str| {
        let nodes = format!(r#"{{{above}, "children": [1]}}, {{"mesh": 0}}"#);
        animated(&nodes, &[(1, "translation", "LINEAR", two, moved)])
    };
    for (bytes, expected) in [
        (
            one(7, "translation", "LINEAR", two, moved),
            "animations[0].channels[0]: expected one of 1 nodes, found 7",
        ),
        (
            one(0, "colour", "LINEAR", two, moved),
            "animations[0].channels[0]: expected translation, rotation",
        ),
        (one(0, "translation", "BEZIER", two, moved), "interpolation"),
        (
            one(0, "translation", "LINEAR", &[1.0, 1.0], moved),
            "accessors[2]: expected finite ascending times",
        ),
        (
            one(0, "translation", "LINEAR", &[0.0, f32::NAN], moved),
            "accessors[2]: expected finite ascending",
        ),
        (
            one(0, "translation", "LINEAR", &[0.0], moved),
            "accessors[3]: expected 1 values, found 2",
        ),
        (
            one(0, "translation", "CUBICSPLINE", two, moved),
            "accessors[3]: expected 6 values, found 2",
        ),
        (
            one(0, "translation", "LINEAR", two, &[&[0.0; 3], &[f32::NAN; 3]]),
            "accessors[3]: expected finite values",
        ),
        (
            one(0, "rotation", "LINEAR", two, &[&[0.0; 4], &[0.0; 4]]),
            "accessors[3]: expected rotations of length 1",
        ),
        (
            one(0, "scale", "LINEAR", two, moved),
            "nodes[0]: expected a scale that stays, found an animated one",
        ),
        (below(r#""scale": [1, 2, 1]"#), "nodes[1]: expected even scales above an animated node"),
        (
            animated(
                r#"{"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}"#,
                &[(0, "translation", "LINEAR", two, moved)],
            ),
            "nodes[0]: expected no matrix, since it is animated",
        ),
        (
            below(r#""rotation": [0, 0, 0, 0]"#),
            "nodes[0]: expected a rotation of length 1, found length 0",
        ),
    ] {
        let error =
            crate::mesh::parse_assembly(&bytes, None, DAffine3::IDENTITY).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}
