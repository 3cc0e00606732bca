//! `sample`: the chosen points, unchanged.

use formats::cloud_file::{read_cloud, write_cloud};

use crate::program::{Folder, strip};

#[test]
fn points_are_chosen_and_not_changed() {
    let folder = Folder::new();
    // A UTM northing with millimetres, of which f32 would keep two digits.
    let cloud: Vec<_> = strip(100).iter().map(|p| [p[0] + 5.5e9, p[1], p[2]]).collect();
    write_cloud(&folder.path("in.npz"), &cloud).unwrap();
    for sampler in ["first", "random", "fps", "voxel"] {
        let ran = folder
            .run(&format!("sample --sampler {sampler} --points 16 in.npz out.npz --overwrite"));
        assert_eq!(ran.code, 0, "{}", ran.err);
        let chosen = read_cloud(&folder.path("out.npz")).unwrap();
        assert!(chosen.iter().all(|point| cloud.contains(point)), "{sampler}");
        assert!((8..=16).contains(&chosen.len()), "{sampler}: {}", chosen.len());
        assert_eq!(ran.out, format!("out.npz: {} of 100 points\n", chosen.len()));
    }
    folder.run("sample --sampler all in.npz out.ply");
    assert_eq!(read_cloud(&folder.path("out.ply")).unwrap(), cloud);
}

#[test]
fn a_voxel_size_is_in_the_cloud_s_unit_wherever_it_lies() {
    let folder = Folder::new();
    let along = |offset: f64| -> Vec<[f64; 3]> {
        (0..100).map(|i| [offset + f64::from(i) * 0.125, 0.0, 0.0]).collect()
    };
    for offset in [0.0, 1e6, -1e6] {
        write_cloud(&folder.path("in.npy"), &along(offset)).unwrap();
        let ran = folder.run("sample --sampler voxel --voxel-size 2.5 in.npy out.npy --overwrite");
        // 12.375 long: five cells of 20 points.
        assert_eq!(ran.out, "out.npy: 5 of 100 points\n", "{offset}: {}", ran.err);
    }
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

#[test]
fn what_cannot_be_sampled_leaves_no_file() {
    let folder = Folder::new();
    folder.write("nan.xyz", "0 0 0\nnan 1 2\n1 1 1\n");
    folder.cloud("c.xyz", &strip(9));
    let none = folder.path("none.npy");
    write_cloud(&none, &[]).unwrap();
    for (code, line, start) in [
        (
            1,
            "--sampler fps --points 2 nan.xyz out.xyz",
            "error: nan.xyz: point 1: expected finite coordinates, found (NaN, 1, 2)",
        ),
        (
            1,
            "--sampler fps --points 2 none.npy out.xyz",
            "error: none.npy: the cloud has no points",
        ),
        (1, "--sampler fps --points 2 absent.xyz out.xyz", "error: absent.xyz: "),
        (1, "--sampler fps --points 2 c.xyz out.off", "error: out.off: extension: "),
        (
            2,
            "--sampler fps --points 0 c.xyz out.xyz",
            "error: expected a sampler that keeps 1 point",
        ),
        (2, "--sampler all --points 2 c.xyz out.xyz", "error: --points does not apply"),
        (2, "--points 2 c.xyz out.xyz", "error: the following required arguments"),
    ] {
        folder.run(&format!("sample {line}")).assert_refused(code, start);
    }
    let left = std::fs::read_dir(folder.path("")).unwrap().count();
    assert_eq!(left, 4, "the model and three clouds");
    let ran = folder.run("sample --drop-invalid --sampler fps --points 2 nan.xyz out.xyz");
    assert_eq!(ran.out, "out.xyz: 2 of 2 points\n");
    assert_eq!(ran.err, "nan.xyz: dropped 1 of 3 points\n");
}
