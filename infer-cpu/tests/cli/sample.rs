//! `sample`: the chosen points, unchanged.

use formats::cloud_file::{read_cloud, write_cloud};

use crate::program::{Folder, strip};

#[test]
fn points_are_chosen_and_not_changed() {
    let folder = Folder::new();
    // A UTM northing with millimetres, of which f32 would keep two digits.
    let cloud: Vec<_> = strip(100).iter().map(|p| [p[0] + 5.5e9, p[1], p[2]]).collect();
    write_cloud(&folder.path("in.npz"), &cloud).unwrap();
    for sampler in ["first", "random", "fps"] {
        let ran = folder
            .run(&format!("sample --sampler {sampler} --points 16 in.npz out.npz --overwrite"));
        assert_eq!(ran.code, 0, "{}", ran.err);
        let chosen = read_cloud(&folder.path("out.npz")).unwrap();
        assert!(chosen.iter().all(|point| cloud.contains(point)), "{sampler}");
        assert_eq!(chosen.len(), 16, "{sampler}");
        assert_eq!(ran.out, "out.npz: 16 of 100 points\n");
    }
    folder.run("sample --sampler all in.npz out.ply");
    assert_eq!(read_cloud(&folder.path("out.ply")).unwrap(), cloud);
}

#[test]
fn critical_points_need_a_model_and_may_be_fewer() {
    let folder = Folder::new();
    folder.cloud("in.xyz", &strip(30));
    let line = "sample --model m.safetensors --sampler cpl --points 64 in.xyz out.xyz";
    let ran = folder.run(line);
    let n = read_cloud(&folder.path("out.xyz")).unwrap().len();
    assert!((1..=30).contains(&n), "{n}");
    assert_eq!(ran.out, format!("out.xyz: {n} of 30 points\n"), "{}", ran.err);
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let folder = Folder::new();
    folder.cloud("in.xyz", &strip(100));
    let bytes = |seed: u32| {
        let line =
            format!("sample --sampler random --points 9 --seed {seed} in.xyz out.xyz --overwrite");
        assert_eq!(folder.run(&line).code, 0);
        std::fs::read(folder.path("out.xyz")).unwrap()
    };
    assert_eq!(bytes(1), bytes(1));
    assert_ne!(bytes(1), bytes(2));
}
