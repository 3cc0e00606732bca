//! `view`: what its pages hold. How a browser shows them is tested by assets/view/test/browser.mjs.

use crate::Folder;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use formats::hash::Hashing;
use formats::packed::PackedWriter;
use serde_json::Value;

/// The data of the page `file`.
fn data(folder: &Folder, file: &str) -> Value {
    let page = folder.text(file);
    assert!(!page.contains("src=") && !page.contains("https://cdn"), "it needs another file");
    let (_, data) = page.split_once("id=\"data\">").unwrap();
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

fn bytes(block: &Value) -> Vec<u8> {
    let (_, base64) = block.as_object().unwrap().iter().next().unwrap();
    STANDARD.decode(base64.as_str().unwrap()).unwrap()
}

fn frame(data: &Value, pane: usize) -> &Value {
    &data["panes"][pane]["frames"][0]
}

#[test]
fn a_page_holds_the_points_their_columns_and_the_boxes() {
    let folder = Folder::new();
    folder.succeeds("gen-scenes street --sweeps 1 --save 1 --seed 3 --adapter cpu --out street");
    let sweep = "street/sweeps/000000.npz";
    folder.succeeds(&format!("detect {sweep} --out objects.json"));
    let said = folder.succeeds(&format!("view {sweep} objects.json --out page.html"));
    let scan = folder.scan(sweep);
    assert!(said.contains(&format!("{} points, ", scan.len())), "{said}");

    let data = data(&folder, "page.html");
    let frame = frame(&data, 0);
    let positions = bytes(&frame["points"]["position"]);
    let expected = scan.positions.as_flattened().iter().flat_map(|x| x.to_le_bytes());
    assert!(positions == expected.collect::<Vec<_>>());
    let columns = frame["points"]["columns"].as_array().unwrap();
    let names: Vec<_> = columns.iter().map(|column| column["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["class", "range", "beam", "ring", "time", "object", "intensity"]);
    // The class of each point is that of its object in the description beside the sweep.
    let described: Value = serde_json::from_str(&folder.text("street/sweeps/000000.json")).unwrap();
    let classes: Vec<_> = bytes(&columns[0]["values"])
        .as_chunks()
        .0
        .iter()
        .copied()
        .map(u32::from_le_bytes)
        .collect();
    for (object, class) in scan.object.as_ref().unwrap().iter().zip(classes) {
        let name = &columns[0]["names"][class as usize];
        match object.checked_sub(1) {
            None => assert_eq!(name, "ground"),
            Some(i) => assert_eq!(*name, described["objects"][i as usize]["class"]),
        }
    }
    let found: Value = serde_json::from_str(&folder.text("objects.json")).unwrap();
    let boxes = frame["boxes"].as_array().unwrap();
    let (truth, detected): (Vec<_>, Vec<_>) =
        boxes.iter().partition(|placed| placed["truth"] == true);
    assert_eq!(detected.len(), found["objects"].as_array().unwrap().len());
    // A car that was found stands where one was drawn, within the size of a person.
    let first = detected.iter().find(|placed| placed["class"] == "car").unwrap();
    let is_near = |other: &&&Value| {
        let off = |axis: usize| {
            let [a, b] = [first, **other].map(|of| of["centre"][axis].as_f64().unwrap());
            a - b
        };
        other["class"] == "car" && off(0).hypot(off(1)) < 0.7 && off(2).abs() < 0.4
    };
    assert!(truth.iter().any(|other| is_near(&other)), "{first}: {truth:?}");
}

#[test]
fn folders_captures_meshes_and_scenes_are_shown() {
    let folder = Folder::with_meshes();
    folder.succeeds("gen-scenes --drive 0.5 --out drive.pcap");
    folder.succeeds("gen-scenes --drive 0.3 --layout semantickitti --out drive");
    folder.succeeds("view drive.pcap drive --out drives.html");
    let drives = data(&folder, "drives.html");
    let n_frames = |pane: usize| drives["panes"][pane]["frames"].as_array().unwrap().len();
    assert!([5, 6].contains(&n_frames(0)), "{}", n_frames(0));
    assert_eq!(n_frames(1), 3);
    let column = &frame(&drives, 1)["points"]["columns"][0];
    assert!(column["names"].as_array().unwrap().contains(&"car".into()), "{column}");
    folder.succeeds("view drive.truth.jsonl --out truth.html");
    assert!(!frame(&data(&folder, "truth.html"), 0)["boxes"].as_array().unwrap().is_empty());

    folder.succeeds("gen-dataset --save-meshes shapes --train 1 --test 1");
    let mesh = "shapes/chair/train/chair_0001.off";
    folder.write(
        "scene.toml",
        format!("[[object]]\nmesh = \"{mesh}\"\nlabel = \"</script>\"\n[[sensor]]\nprofile = \"vlp16\"\nposition_m = [3, 0, 1]\nlook_at_m = [0, 0, 0]\n"),
    );
    folder.succeeds(&format!("view {mesh} scene.toml --out two.html"));
    folder.succeeds(&format!("scan {mesh} --out one.npz"));
    // A picture shows the first of what a page shows.
    let boxes = frame(&data(&folder, "truth.html"), 0)["boxes"].as_array().unwrap().len();
    for (inputs, expected) in [
        (mesh, "1 mesh: scan.png".to_owned()),
        (&*format!("{mesh} one.npz"), " points, 1 mesh: scan.png".to_owned()),
        ("drive.truth.jsonl", format!("{boxes} boxes: scan.png")),
        ("drive.pcap drive.truth.jsonl", " boxes: scan.png".to_owned()),
    ] {
        let said = folder.succeeds(&format!("view {inputs} --overwrite --out scan.png"));
        assert!(said.contains(&expected), "{said}");
    }
    let two = data(&folder, "two.html");
    assert_eq!(frame(&two, 0)["points"], Value::Null);
    assert_eq!(frame(&two, 1)["meshes"][0]["class"], "</script>");
    // A ray has two ends of three numbers of four bytes, and each ray ends at a point.
    let [rays, points] = ["/sensors/0/rays", "/points/position"]
        .map(|at| bytes(frame(&two, 1).pointer(at).unwrap()));
    assert!(!rays.is_empty() && rays.len() == 2 * points.len());
}

/// The sensor of `gen-scenes --drive` moves at 5 m/s, 0.5 m a turn, within which its points lie where it was.
#[test]
fn boxes_in_the_world_stand_around_the_points_of_a_drive() {
    let folder = Folder::new();
    folder.succeeds("gen-scenes --drive 0.3 --out drive.pcap");
    folder.succeeds("view drive.pcap --truth drive.truth.jsonl --out drive.html");
    let data = data(&folder, "drive.html");
    let truth: Vec<Value> = folder
        .text("drive.truth.jsonl")
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let turn = &data["panes"][0]["frames"][1];
    let positions = bytes(&turn["points"]["position"]);
    let positions: Vec<f32> =
        positions.as_chunks().0.iter().copied().map(f32::from_le_bytes).collect();
    let boxes = turn["boxes"].as_array().unwrap();
    assert!(boxes.len() > 10);
    for placed in boxes {
        let number = |at: &str| placed.pointer(at).unwrap().as_f64().unwrap();
        let (sin, cos) = number("/yaw").sin_cos();
        let inside = positions.as_chunks::<3>().0.iter().filter(|point| {
            let off = |axis: usize| f64::from(point[axis]) - number(&format!("/centre/{axis}"));
            let [x, y, z] = [0, 1, 2].map(off);
            let own = [cos * x + sin * y, cos * y - sin * x, z];
            (0..3).all(|axis| own[axis].abs() < 0.5 * number(&format!("/size/{axis}")) + 0.5)
        });
        let is_of = |of: &&Value| of["turn"] == 1 && of["object"] == placed["track"];
        let points = truth.iter().find(is_of).unwrap()["points"].as_u64().unwrap();
        assert!(inside.count() as u64 >= points, "{placed}");
    }
    let view = "view drive.pcap drive.truth.jsonl --out a.html";
    let poses = folder.text("drive.tum").replace("\n9466848", "\n9467848");
    folder.write("drive.tum", poses);
    folder.refuses(1, &[(view, "drive.tum: times: expected poses from 946684800")]);
    std::fs::remove_file(folder.at("drive.tum")).unwrap();
    folder.refuses(2, &[(view, "no poses of the sensor in drive.tum: copy them there")]);
}

#[test]
fn a_set_is_viewed_unless_it_is_damaged() {
    let folder = Folder::new();
    let mut writer = PackedWriter::create(&folder.at("set.npz"), 1, vec!["a".into()]).unwrap();
    writer.push(&[[0.0; 3]], 0, "a_1", 1).unwrap();
    writer.finish(Hashing::None).unwrap();
    folder.succeeds("view set.npz --out set.html");
    let mut set = folder.bytes("set.npz");
    for at in 0..set.len() - 10 {
        if set[at..].starts_with(b"points.npy") {
            set[at] = b'j';
        }
    }
    folder.write("set.npz", set);
    let cause = "expected a packed set of labelled clouds";
    folder.refuses(1, &[("view set.npz --out a.html", cause)]);
    assert!(!folder.at("a.html").exists());
}
