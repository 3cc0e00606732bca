//! `sample-surfaces`: points of whole meshes and visible points.

use crate::Folder;
use formats::labelled::read_labelled;

fn with_shapes() -> Folder {
    let folder = Folder::new();
    folder.succeeds("gen-shapes --out shapes --train 1 --test 1");
    folder
}

#[test]
fn surfaces_are_sampled_whole_and_as_a_sensor_sees_them() {
    let folder = with_shapes();
    folder.succeeds("sample-surfaces shapes --out a --points 200");
    let [whole, seen] =
        ["surface", "seen"].map(|set| read_labelled(&folder.at(&format!("a/{set}-test.npz"))));
    let (whole, seen) = (whole.unwrap(), seen.unwrap());
    let (names, seen_names) = (whole.names.as_ref().unwrap(), seen.names.as_ref().unwrap());
    assert_eq!((whole.len(), whole.smallest_cloud(), seen.len()), (10, 200, 40));
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
        // In the frame of the whole mesh: visible points exceed it only as far as samples differ.
        assert!(seen.cloud(view).iter().all(|p| radius(p) < 1.2));
        // Some of the 1,200 points are visible, and some are not.
        let n_raw = seen.n_raw.as_ref().unwrap()[view];
        assert!((64..1200).contains(&n_raw), "{n_raw}");
    }
    folder.succeeds("sample-surfaces shapes --out b --points 200");
    folder.assert_same_tree("a", "b");
}

#[test]
fn what_is_doubtful_about_a_mesh_is_told_once_by_every_command() {
    let folder = with_shapes();
    // The edges of its second face cross.
    let crossed = "v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 5\nf 1 2 3 4\n";
    folder.write("shapes/cup/test/crossed.obj", crossed);
    folder.write("own/cups/crossed.obj", crossed);
    folder.write(
        "own.toml",
        "sensor = [{ profile = \"vlp16\" }]\nmount = { height_m = [1, 1] }\n[[object]]\n\
         kind = \"mesh\"\nclass = \"cup\"\ncount = [1, 1]\nplace = \"anywhere\"\n\
         distance_m = [2, 3]\nmeshes = \"cups\"\nheight_m = [1, 1]\n",
    );
    for words in [
        "sample-surfaces shapes --out surfaces --points 50",
        "corrupt shapes --views 1 --points 50 --severity 1 --only jitter --out corrupted",
        "gen-scenes own.toml --meshes own --sweeps 1 --out scenes",
        "gen-dataset shapes --views 1 --out data",
        "gen-drive own.toml --meshes own --seconds 0.1 --out drive.pcap",
    ] {
        let said = folder.succeeds(words);
        let told = said.lines().filter(|line| line.contains("crossed.obj"));
        let told: Vec<&str> = told.filter(|line| line.contains("warning")).collect();
        assert!(matches!(told[..], [one] if one.contains("cross")), "{words}: {said}");
    }
}

#[test]
fn a_bad_mesh_is_named_and_the_others_go_on() {
    let folder = with_shapes();
    folder.write("shapes/cup/test/flat.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2");
    folder.write("shapes/cup/test/torn.off", "OFF\n3 1 0\n0 0 0\n1 0");
    let said = folder.exits(3, "sample-surfaces shapes --out out --points 50");
    for part in
        ["cup/test/flat.off: no triangle has an area", "cup/test/torn.off:4", "20 meshes: out"]
    {
        assert!(said.contains(part), "{part} in {said}");
    }
    folder.refuses(1, &[("sample-surfaces nowhere --out other", "nowhere")]);
    assert!(!folder.at("other").exists());
}
