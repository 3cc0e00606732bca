//! Scans by sensors that are not rotating heads.

use crate::Folder;

#[test]
fn rosettes_tables_and_many_revolutions_make_scenes_and_datasets() {
    let folder = Folder::with_meshes();
    folder.write("wall.off", "OFF\n4 1 0\n5 -30 -10\n5 30 -10\n5 30 10\n5 -30 10\n4 0 3 2 1\n");
    let scene = |sensor: &str| {
        format!(
            "attributes = [\"time\", \"ring\"]\n[[object]]\nmesh = \"wall.off\"\n[[sensor]]\n{sensor}\n"
        )
    };
    let n_points = |sensor: &str| {
        folder.write("scene.toml", scene(sensor));
        folder.succeeds("scan scene.toml --adapter cpu --overwrite --out scan.npz");
        folder.scan("scan.npz").len()
    };
    let avia = "profile = \"avia\"\nposition_m = [0, 0, 0]\nyaw_deg = 0\n";
    let one = n_points(avia);
    let three = n_points(&format!("{avia}revolutions = 3\n"));
    assert!(one == 24_000 && three == 72_000, "{one} {three}");
    let times = folder.scan("scan.npz").time_s.unwrap();
    assert!(times.iter().any(|&time_s| time_s > 0.29), "the scan goes on");

    // Poses in the scene itself: it goes 10 m/s towards the wall.
    let poses = "trajectory = [{ time_s = 0, position_m = [0, 0, 0], yaw_deg = 0 }, \
                 { time_s = 1, position_m = [10, 0, 0], yaw_deg = 0 }]\n";
    n_points(&format!("profile = \"ld19\"\n{poses}deskew = true\n"));
    assert!(folder.scan("scan.npz").positions.iter().all(|p| (p[0] - 5.0).abs() < 1e-5));

    folder.write("rows.csv", "azimuth_deg,elevation_deg\n0,0\n2,1\n-2,-1\n");
    folder.write(
        "own.toml",
        "name = \"own\"\nrange = { max_m = 10 }\n\
         [table]\nfile = \"rows.csv\"\npulse_hz = 1000\nperiod_s = 0.1\n",
    );
    assert_eq!(n_points("profile = \"own.toml\"\nposition_m = [0, 0, 0]\nyaw_deg = 0\n"), 100);
    folder.succeeds("gen-dataset meshes --out out --adapter cpu --sensor avia --views 1");
    folder.succeeds("gen-dataset --verify out");
}

#[test]
fn scans_of_other_times_have_other_noise() {
    let folder = Folder::new();
    folder.write("wall.off", "OFF\n4 1 0\n5 -30 -10\n5 30 -10\n5 30 10\n5 -30 10\n4 0 3 2 1\n");
    let scan = |start: &str| {
        folder.write(
            "scene.toml",
            format!(
                "[effects]\nnoise = {{ sigma_m = 0.05 }}\n[[object]]\nmesh = \"wall.off\"\n\
                 [[sensor]]\nprofile = \"ld19\"\nposition_m = [0, 0, 0]\nyaw_deg = 0\n{start}\n"
            ),
        );
        folder.succeeds("scan scene.toml --adapter cpu --overwrite --out scan.npz");
        folder.scan("scan.npz").positions
    };
    let first = scan("");
    assert_eq!(scan("start_s = 0"), first);
    let later = scan("start_s = 0.1");
    let n_same = first.iter().zip(&later).filter(|(a, b)| a == b).count();
    assert!(first.len() > 100 && n_same == 0, "{n_same} of {}", first.len());
}
