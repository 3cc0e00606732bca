//! `sample-surfaces`: what scans are compared with.

use crate::{exits, succeeds, tree};
use formats::labelled::read_labelled;

#[test]
fn surfaces_are_sampled_whole_and_as_a_sensor_sees_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    succeeds(at, "gen-shapes --out shapes --train 1 --test 1");
    succeeds(at, "sample-surfaces shapes --out a --points 200");
    let whole = read_labelled(&at.join("a/surface-test.npz")).unwrap();
    let seen = read_labelled(&at.join("a/seen-test.npz")).unwrap();
    let (names, seen_names) = (whole.names.as_ref().unwrap(), seen.names.as_ref().unwrap());
    assert_eq!((whole.len(), whole.n_points, seen.len()), (10, 200, 40));
    let radius = |p: &[f32; 3]| p.iter().map(|x| x * x).sum::<f32>().sqrt();
    for (i, name) in names.iter().enumerate() {
        let largest = whole.cloud(i).iter().map(radius).fold(0.0, f32::max);
        assert!((largest - 1.0).abs() < 1e-6, "{largest}");
        let of_mesh = |seen: &str| seen.strip_suffix("_v0") == Some(name);
        let view = seen_names.iter().position(|name| of_mesh(name)).unwrap();
        // Views 0 and 2 are from +x and -x: each sees more of its own side.
        let mean = |cloud: &[[f32; 3]]| cloud.iter().map(|p| p[0]).sum::<f32>() / 200.0;
        let [front, back] = [view, view + 2].map(|view| mean(seen.cloud(view)));
        assert!(front > back, "{name}: {front}, {back}");
        // In the whole's frame: nothing beyond it but what other samples miss.
        assert!(seen.cloud(view).iter().all(|p| radius(p) < 1.2));
        // Of 1,200 points looked at not all are seen, and not none.
        let n_raw = seen.n_raw.as_ref().unwrap()[view];
        assert!((64..1200).contains(&n_raw), "{n_raw}");
    }
    succeeds(at, "sample-surfaces shapes --out b --points 200");
    assert_eq!(tree(&at.join("a")), tree(&at.join("b")));
}

#[test]
fn a_bad_mesh_is_named_and_the_others_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    succeeds(at, "gen-shapes --out shapes --train 1 --test 1");
    std::fs::write(at.join("shapes/cup/test/flat.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2")
        .unwrap();
    std::fs::write(at.join("shapes/cup/test/torn.off"), "OFF\n3 1 0\n0 0 0\n1 0").unwrap();
    let said = exits(1, at, "sample-surfaces shapes --out out --points 50");
    assert!(said.contains("cup/test/flat.off: no triangle with an area"), "{said}");
    assert!(said.contains("cup/test/torn.off:4"), "{said}");
    assert!(said.contains("20 meshes: out"), "{said}");
    let missing = exits(1, at, "sample-surfaces nowhere --out other");
    assert!(missing.contains("nowhere") && !at.join("other").exists(), "{missing}");
}
