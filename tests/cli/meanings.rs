//! Commands tell the user what is wrong in meaning: stale and damaged files, flags and columns without
//! effect.

use crate::Folder;

const SMALL: &str = "--adapter cpu --sensor vlp16 --points 64 --views 1";

#[test]
fn a_complete_dataset_is_compared_with_its_meshes_and_files() {
    let folder = Folder::with_meshes();
    let resume = format!("gen-dataset meshes {SMALL} --out out --resume");
    folder.succeeds(&format!("gen-dataset meshes {SMALL} --out out"));
    assert!(folder.succeeds(&resume).contains("already complete"));
    let mesh = "meshes/ball/train/ball_0001.off";
    let ball = folder.text(mesh);
    folder.write(mesh, ball.replacen("0.", "0.1", 1));
    let said = folder.exits(1, &resume);
    assert!(said.contains("ball_0001.off has changed since: --overwrite makes it again"), "{said}");
    folder.write(mesh, ball);
    let packed = std::fs::read_dir(folder.at("out/packed")).unwrap().next().unwrap().unwrap();
    let bytes = std::fs::read(packed.path()).unwrap();
    std::fs::write(packed.path(), [&bytes[..], b"x"].concat()).unwrap();
    let said = folder.exits(1, &resume);
    assert!(said.contains("was changed: its SHA-256"), "{said}");
    std::fs::remove_file(packed.path()).unwrap();
    let said = folder.exits(1, &resume);
    assert!(said.contains("is missing: --overwrite makes it again"), "{said}");
}

#[test]
fn overwriting_keeps_what_is_there_until_all_is_checked_and_leaves_nothing_of_it() {
    let folder = Folder::new();
    folder.succeeds("gen-scenes room --sweeps 1 --layout kitti --out out");
    let before = tests::tree::files(&folder.at("out"));
    folder.exits(1, "gen-scenes room --sweeps 1 --out out --overwrite --sensor vlp61");
    assert!(tests::tree::files(&folder.at("out")) == before);
    let said = folder.succeeds("gen-scenes room --sweeps 1 --out out --overwrite");
    assert!(said.contains("warning: out/kitti: it is of another run, and stays"), "{said}");
    std::fs::remove_dir_all(folder.at("out/packed")).unwrap();
    std::fs::remove_dir_all(folder.at("out/sweeps")).unwrap();
    folder
        .refuses(2, &[("gen-scenes room --sweeps 1 --out out", "preview.png: it exists already")]);
    let sweep = "out/sweep.npz";
    folder.write(sweep, before[std::path::Path::new("sweeps/000000.npz")].clone());
    folder.succeeds("corrupt out/sweep.npz --only fog,snow --severity 1,2 --out w");
    folder.succeeds("corrupt out/sweep.npz --only fog --severity 1 --out w --overwrite");
    let left: Vec<_> = tests::tree::files(&folder.at("w")).into_keys().collect();
    assert_eq!(left, ["corruptions.csv", "fog-1.npz"].map(std::path::PathBuf::from));
    // Files of others stay, whatever their names are, and so does the input.
    folder.write("w/frame-12.npz", folder.bytes(sweep));
    folder.write("w/frame-11.npz", "mine");
    folder.succeeds("corrupt w/frame-12.npz --only fog --severity 1 --out w --overwrite");
    assert_eq!(folder.text("w/frame-11.npz"), "mine");
    assert!(folder.at("w/frame-12.npz").exists());
}
