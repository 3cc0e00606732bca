//! Tests of the reader of glTF.

use super::*;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

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
fn faults_are_named_with_their_places() {
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
fn bounds_and_extensions_may_be_missing_or_unknown() {
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

#[test]
fn parts_have_names_and_share_meshes() {
    let nodes = r#"{"name": "left", "mesh": 0, "children": [1]}, {"mesh": 0, "scale": [-1, 1, 1]}"#;
    let file = glb(&json(nodes, 4, 3), &buffer());
    let Assembly { meshes, parts, warnings, .. } =
        assemble(&file, None, DAffine3::from_translation(DVec3::X)).unwrap();
    assert_eq!((meshes.len(), parts.len(), warnings.len()), (1, 2, 0));
    assert_eq!([&parts[0].name, &parts[1].name], ["left", "nodes[1]"]);
    assert_eq!(parts[0].world_from_mesh.translation, DVec3::X);
    let parsed = parse(&file, None).unwrap();
    assert_eq!(parsed.mesh.triangles, [[0, 1, 2], [4, 6, 5]]);
}

#[test]
fn animated_nodes_stand_at_rest_with_a_warning() {
    let animations = r#""animations": [{"channels": [{"sampler": 0, "target": {"node": 0, "path":
        "translation"}}], "samplers": [{"input": 0, "output": 0}]}], "buffers""#;
    let text = json(NODE, 4, 3).replace(r#""buffers""#, animations);
    let found = assemble(&glb(&text, &buffer()), None, DAffine3::IDENTITY).unwrap();
    assert_eq!(found.parts[0].world_from_mesh, DAffine3::IDENTITY);
    assert_eq!(found.warnings, [Warning::Animations]);
}

#[test]
fn a_skin_stands_where_it_was_bound_wherever_its_node_is() {
    let node = r#"{"mesh": 0, "skin": 0, "translation": [100, 0, 0]}"#;
    let text = json(node, 4, 3).replace(r#""meshes""#, r#""skins": [{"joints": [0]}], "meshes""#);
    let root = DAffine3::from_translation(DVec3::X);
    let found = assemble(&glb(&text, &buffer()), None, root).unwrap();
    assert_eq!((found.parts[0].world_from_mesh, found.warnings), (root, vec![Warning::Skin]));
}

#[test]
fn rotation_of_length_0_is_an_error() {
    let file = glb(&json(r#"{"rotation": [0, 0, 0, 0], "mesh": 0}"#, 4, 3), &buffer());
    let error = parse(&file, None).unwrap_err().to_string();
    assert_eq!(error, "nodes[0]: expected a rotation of length 1, found length 0");
}
