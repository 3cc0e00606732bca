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
fn a_damaged_shard_is_not_merged() {
    let folder = Folder::with_meshes();
    for shard in 1..=2 {
        folder.succeeds(&format!("gen-dataset meshes {SMALL} --shard {shard}/2 --out s{shard}"));
    }
    let files = tests::tree::files(&folder.at("s2"));
    let is_scan = |path: &&std::path::PathBuf| {
        path.extension().is_some_and(|extension| extension == "npz") && !path.starts_with("packed")
    };
    let scan = files.keys().find(is_scan);
    let scan = scan.unwrap().to_str().unwrap().to_owned();
    folder.write(&format!("s2/{scan}"), "x");
    let said = folder.exits(1, "merge-dataset s1 s2 --out whole");
    assert!(said.contains(&format!("s2: {scan}: was changed")), "{said}");
    assert!(!folder.at("whole").exists());
}

#[test]
fn a_set_without_an_object_is_no_success_and_a_capture_without_a_turn_is_told() {
    let folder = Folder::with_meshes();
    folder.write(
        "bare.toml",
        r#"
        description = "A plane without an object"
        [ground]
        half_m = 60
        [mount]
        height_m = [1.0, 2.0]
        [[sensor]]
        profile = "vlp16"
        [[object]]
        kind = "wall"
        class = "wall"
        count = [0, 0]
        place = "line"
        distance_m = [5, 50]
        "#,
    );
    let said = folder.exits(3, "gen-scenes bare.toml --sweeps 10 --save 0 --out bare");
    assert!(said.contains("no object is in a cluster"), "{said}");
    let noisy = "gen-dataset meshes --sensor vlp16 --views 1 --dropout 1 --adapter cpu --out noisy";
    let said = folder.exits(3, noisy);
    assert!(said.contains("rotational-noisy-train.npz holds no cloud"), "{said}");
    folder.succeeds("gen-drive room --seconds 0.05 --out short.pcap");
    let said = folder.succeeds("live --pcap short.pcap");
    assert!(said.contains("short.pcap: no object was found among"), "{said}");
    let said = folder.exits(1, "merge-dataset bare/packed noisy --out whole");
    assert!(!said.contains("os error"), "{said}");
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

#[test]
fn recipes_with_no_word_for_a_class_or_no_point_are_told() {
    let folder = Folder::new();
    let recipe = |class: &str, height_m: &str| {
        format!(
            "[ground]\nhalf_m = 20\n[mount]\nheight_m = {height_m}\n[[sensor]]\nprofile = \"vlp16\"\n\
             [[object]]\nkind = \"person\"\nclass = \"{class}\"\ncount = [1, 1]\nplace = \"anywhere\"\n\
             distance_m = [3, 8]\n"
        )
    };
    for class in ["", "big car", "ground", "air"] {
        folder.write("r.toml", recipe(class, "[1.7, 1.7]"));
        let said = folder.exits(1, "gen-scenes r.toml --sweeps 1 --out out");
        assert!(said.contains("object[0].class: expected one word other than"), "{class}: {said}");
    }
    folder.write("r.toml", recipe("person", "[100, 100]"));
    let said = folder.exits(3, "gen-scenes r.toml --sweeps 1 --out out");
    assert!(said.contains("warning: no beam returned a point"), "{said}");
}

#[test]
fn effects_that_nothing_can_have_are_refused() {
    let folder = Folder::new();
    folder.write("a.off", "OFF\n3 1 0\n5 0 0\n5 1 0\n5 0 1\n3 0 1 2\n");
    folder.write("a.tum", "0 0 0 0 0 0 0 1\n9 1 0 0 0 0 0 1\n");
    let scene = |sensor: &str, effects: &str| {
        format!(
            "[[object]]\nmesh = \"a.off\"\n[[sensor]]\nprofile = \"vlp16\"\n{sensor}\n[effects]\n{effects}\n"
        )
    };
    let motion = "motion = { velocity_m_s = [30, 0, 0] }";
    for (sensor, effects, cause) in [
        (
            "trajectory = \"a.tum\"",
            motion,
            "effects.motion: expected a sensor without a trajectory",
        ),
        (
            "position_m = [0, 0, 0]\nyaw_deg = 0",
            "weather = { fog_model = \"hahner\", rain_mm_h = 5 }",
            "effects.weather.fog_model: expected fog_visibility_m",
        ),
    ] {
        folder.write("s.toml", scene(sensor, effects));
        let said = folder.exits(1, "scan s.toml --out x.npz --adapter cpu");
        assert!(said.contains(cause), "{said}");
    }
}

#[test]
fn files_of_another_format_or_size_are_told() {
    let folder = Folder::new();
    folder.write("a.xyz", "0 0 0\n1 0 0\n0 1 0\n0 0 1\n");
    folder.succeeds("sample --sampler all a.xyz a.npz");
    std::fs::copy(folder.at("a.npz"), folder.at("b.ply")).unwrap();
    folder.write("cr.xyz", "1 2 3\r4 5 6\r7 8 9\r");
    folder.write("far.xyz", "450000.03 5400000.028 100\n450001.1 5400000.094 101\n");
    folder.write("mm.xyz", "12000 0 0\n12500 10 300\n12600 20 900\n12700 0 1700\n");
    folder.write("a", "OFF");
    folder.refuses(
        1,
        &[
            ("sample --sampler all b.ply c.xyz", "b.ply: format: expected ply, found npz by the f"),
            ("sample --sampler all cr.xyz c.xyz", "cr.xyz: line 1: expected lines that end in LF"),
            (
                "sample --sampler all far.xyz c.bin",
                "c.bin: points: f32, the format's only type, changes",
            ),
            ("classify --model street-128 mm.xyz", "mm.xyz: point 0: expected metres from the sen"),
        ],
    );
    folder.refuses(
        2,
        &[(
            "scan a --out x.npz",
            "a: expected a mesh (.obj, .off, .ply, .stl, .glb, .gltf, .urdf) or a scene",
        )],
    );
}
