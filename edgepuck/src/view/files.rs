//! Files and folders, as frames or boxes.

use super::boxes;
use super::frame::{Frame, Labels, Placed};
#[cfg(feature = "mcap")]
use super::recording;
use super::scene;
use super::{MOST_FRAMES, MOST_POINTS};
use crate::points::{PointsArgs, warn_of_packets};
use crate::{Usage, colours};
use anyhow::{Context, bail, ensure};
use edgepuck_mesh::MeshFormat;
use edgepuck_mesh::import::Format;
use formats::cloud_file::{CloudFormat, must_be_scan};
use formats::labelled::{is_labelled, read_labelled};
use formats::turns::read_turns;
use formats::{FormatError, Scan, Senders, ouster, pcap};
use std::collections::HashMap;
use std::fs;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// What a file holds.
pub enum Content {
    Frames(Vec<Frame>),
    Boxes(Vec<Placed>),
}

/// Reads a file or a folder of any kind.
pub fn read(file: &Path, points: &PointsArgs) -> anyhow::Result<Content> {
    let extension = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    Ok(Content::Frames(match &*extension {
        _ if file.is_dir() => folder(file, points)?,
        "json" | "jsonl" => return Ok(Content::Boxes(boxes::read(file)?)),
        _ if points.is_capture(file) => turns(file, points)?,
        #[cfg(feature = "mcap")]
        "mcap" => recording::read(file)?,
        "ply" if !has_faces(file) => vec![cloud(file, points)?],
        "toml" | "urdf" => vec![scene::read(file)?],
        _ if Format::from_path(file).is_some() => vec![scene::read(file)?],
        _ if MeshFormat::from_path(file).is_some() => vec![scene::of_mesh(file)?],
        "npz" if points.input_format.is_none() && !must_be_scan(file) => set(file, points)?,
        // The reader of points tells what is wrong with these.
        "" | "laz" => vec![cloud(file, points)?],
        _ if points.input_format.is_none() && file.is_file() && !is_shown(file) => {
            bail!(Usage(unknown(file, &extension)))
        }
        _ => vec![cloud(file, points)?],
    }))
}

/// Why `view` cannot show a file, and what to do.
fn unknown(file: &Path, extension: &str) -> String {
    let found = match extension {
        "tar" => "a tar: unpack it with `tar -xf`, and show a file of it",
        "xml" | "mjcf" => "a model of MuJoCo: show a scan of it, by Python's `ep.view(scan)`",
        "xacro" | "sdf" => "a robot of another format: convert it to a URDF",
        "mcap" => "a recording: build edgepuck with its feature mcap",
        "safetensors" | "pt" | "pth" | "onnx" => "a network: `eval` and `classify` use it",
        _ => "another file: export it as one of these, or give --input-format",
    };
    let kinds = "points (.npz, .ply, .npy, .pcd, .csv, .las, .bin), a capture (.pcap), a recording \
                 (.mcap), a mesh (.stl, .obj, .off, .glb, .gltf), a robot (.urdf), a scene (.toml), \
                 boxes (.json, .jsonl) or a folder of these";
    format!("{}: expected {kinds}, found {found}", file.display())
}

/// What a picture may show of a file or a folder of any kind: all frames, or of a capture the first whole turn.
pub fn read_first(file: &Path, points: &PointsArgs) -> anyhow::Result<Content> {
    match points.is_capture(file) {
        true => Ok(Content::Frames(vec![cloud(file, points)?])),
        false => read(file, points),
    }
}

/// The points in `file`; with the classes that labels beside it have, or with the objects that
/// `gen-scenes` describes beside it.
fn cloud(file: &Path, points: &PointsArgs) -> anyhow::Result<Frame> {
    let mut scan = points.read(file)?;
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut labels = semantic_labels(file, scan.len())?;
    let is_finite = |i: &usize| scan.positions[*i].iter().all(|x| x.is_finite());
    let finite: Vec<usize> = (0..scan.len()).filter(is_finite).collect();
    if finite.len() < scan.len() {
        let (n, all, file) = (scan.len() - finite.len(), scan.len(), file.display());
        program::say!("{file}: {n} of {all} points without finite coordinates are left out");
        scan = scan.select(&finite);
        for Labels { values, .. } in &mut labels {
            *values = finite.iter().map(|&i| values[i]).collect();
        }
    }
    let truth = description(file)?;
    labels.extend(scan.object.as_ref().filter(|_| !truth.is_empty()).map(|of| classes(of, &truth)));
    Ok(Frame { boxes: truth, ..Frame::of_scan(name, scan, labels) })
}

/// What `gen-scenes` describes beside the sweep.
fn description(sweep: &Path) -> anyhow::Result<Vec<Placed>> {
    let beside = sweep.with_extension("json");
    if !beside.is_file() {
        return Ok(Vec::new());
    }
    boxes::described(&beside).with_context(|| {
        let (sweep, beside) = (sweep.display(), beside.display());
        format!("{sweep}: expected its description in {beside}: write it again, or move it away")
    })
}

/// The class of each point by the number of its object.
fn classes(objects: &[u32], truth: &[Placed]) -> Labels {
    let named = truth.iter().filter_map(|placed| Some((placed.track?, placed.class.as_deref()?)));
    let named: HashMap<u64, &str> = named.chain([(0, "ground")]).collect();
    class_labels(objects.iter().map(|object| *named.get(&u64::from(*object)).unwrap_or(&"other")))
}

/// The class of each point by its name.
pub fn class_labels<'a>(of_points: impl Iterator<Item = &'a str>) -> Labels {
    let (mut names, mut numbers) = (Vec::new(), HashMap::new());
    let number = |name: &'a str| {
        *numbers.entry(name).or_insert_with(|| {
            names.push(name.to_owned());
            names.len() as u32 - 1
        })
    };
    let values = of_points.map(number).collect();
    Labels { name: "class", values, names: Some(names) }
}

/// Whether the PLY file has triangles: then it is a mesh.
fn has_faces(file: &Path) -> bool {
    let mut start = Vec::new();
    let read = fs::File::open(file).and_then(|file| file.take(4096).read_to_end(&mut start));
    let text = String::from_utf8_lossy(&start);
    let header = text.split("end_header").next().unwrap_or_default();
    let mut elements = header.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    read.is_ok()
        && elements.any(
            |words| matches!(words[..], ["element", "face" | "tristrips", count] if count != "0"),
        )
}

/// The labels of SemanticKITTI of `velodyne/N.bin`, which are in `labels/N.label`.
fn semantic_labels(file: &Path, n_points: usize) -> anyhow::Result<Vec<Labels>> {
    let sequence =
        file.parent().filter(|folder| folder.ends_with("velodyne")).and_then(Path::parent);
    let stem = file.file_stem().unwrap_or_default();
    let Some(found) = sequence
        .map(|sequence| sequence.join("labels").join(stem).with_extension("label"))
        .filter(|labels| labels.is_file())
    else {
        return Ok(Vec::new());
    };
    let bytes = fs::read(&found).map_err(|source| FormatError::io(&found, source))?;
    let (words, rest) = bytes.as_chunks::<4>();
    ensure!(
        rest.is_empty() && words.len() == n_points,
        "{}: expected 4 bytes for each of {n_points} points, found {}",
        found.display(),
        bytes.len()
    );
    let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
    // Those that move have the names of those that stand.
    let class = class_labels(words.iter().map(|word| colours::semantic_kitti(*word as u16)));
    let objects = words.iter().map(|word| word >> 16).collect();
    Ok(vec![class, Labels { name: "object", values: objects, names: None }])
}

/// A packed set, a frame for each cloud; or else a cloud.
fn set(file: &Path, points: &PointsArgs) -> anyhow::Result<Vec<Frame>> {
    let set = match read_labelled(file) {
        Ok(set) => set,
        Err(flaw) => match cloud(file, points) {
            Err(_) if is_labelled(file) => return Err(flaw.into()),
            cloud => return Ok(vec![cloud?]),
        },
    };
    let shown = set.len().min(MOST_FRAMES);
    if shown < set.len() {
        let file = file.display();
        program::say!("{file}: the first {shown} of {} clouds are shown", set.len());
    }
    let frame = |i: usize| {
        let positions = set.cloud(i).to_vec();
        let label = set.labels[i];
        let class = set.classes.as_ref().map_or(label.to_string(), |names| names[label].clone());
        let name = set.names.as_ref().map_or_else(String::new, |names| names[i].clone());
        let name = format!("{class} {name}");
        let labels = class_labels(std::iter::repeat_n(&*class, positions.len()));
        Frame::of_scan(name, Scan { positions, ..Scan::default() }, vec![labels])
    };
    Ok((0..shown).map(frame).collect())
}

/// The sweeps of a sequence or of a folder, the scans of a data set, or the meshes in it; or the clusters
/// that `detect --segment-only` wrote, as one frame.
fn folder(folder: &Path, points: &PointsArgs) -> anyhow::Result<Vec<Frame>> {
    for inside in ["sweeps", "velodyne"] {
        if folder.join(inside).is_dir() {
            return self::folder(&folder.join(inside), points);
        }
    }
    let entries = fs::read_dir(folder).map_err(|source| FormatError::io(folder, source))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|file| file.is_file())
        .collect();
    files.sort();
    let is_cluster = |file: &&PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("cluster-") && name.ends_with(".npy")
    };
    if files.iter().any(|file| is_cluster(&file)) {
        let clusters: Vec<&PathBuf> = files.iter().filter(is_cluster).collect();
        return Ok(vec![of_clusters(&clusters, points)?]);
    }
    if !files.iter().any(|file| is_shown(file)) {
        files = below(folder)?;
    }
    files.retain(|file| is_shown(file));
    keep_commonest_extension(&mut files);
    let cause = "expected a folder of sweeps, scans, meshes or clusters, found none in it";
    ensure!(!files.is_empty(), Usage(format!("{}: {cause}", folder.display())));
    let frames = of_files(folder, &files, points)?;
    if frames.len() < files.len() {
        program::say!("{}: {} of {} are shown", folder.display(), frames.len(), files.len());
    }
    Ok(frames)
}

/// A frame for each of the `files`, or of many for so few, evenly, that a page can show their points.
fn of_files(folder: &Path, files: &[PathBuf], points: &PointsArgs) -> anyhow::Result<Vec<Frame>> {
    let is_cloud = |file: &Path| CloudFormat::of_path(file).is_ok() && !has_faces(file);
    let (mut n_points, mut frames) = (0, Vec::new());
    let mut begun = is_cloud(&files[0]).then(|| cloud(&files[0], points));
    let n_first = begun.iter().flatten().map(Frame::n_points).sum::<usize>();
    let every = (files.len() * n_first).div_ceil(MOST_POINTS).max(1);
    for (file, number) in files.iter().zip(0..).step_by(every) {
        let name = file.strip_prefix(folder).unwrap_or(file).to_string_lossy().into_owned();
        let read = || if is_cloud(file) { cloud(file, points) } else { first(file, points) };
        match begun.take().unwrap_or_else(read) {
            Ok(frame) => {
                n_points += frame.n_points();
                frames.push(Frame { name, turn: Some(number), ..frame });
            }
            Err(error) if number + 1 == files.len() as u64 && frames.is_empty() => {
                return Err(error);
            }
            Err(error) => program::say!("warning: a file is left out: {error:#}"),
        }
        // So many that memory holds them.
        if n_points > 3 * MOST_POINTS || frames.len() >= MOST_FRAMES {
            break;
        }
    }
    Ok(frames)
}

/// The first frame of a file that has some.
fn first(file: &Path, points: &PointsArgs) -> anyhow::Result<Frame> {
    match read(file, points)? {
        Content::Frames(frames) => Ok(frames.into_iter().next().unwrap_or_default()),
        Content::Boxes(_) => Ok(Frame::default()),
    }
}

fn is_shown(file: &Path) -> bool {
    let is_cloud = CloudFormat::of_path(file).is_ok() || pcap::is_capture(file);
    is_cloud || MeshFormat::from_path(file).is_some() || Format::from_path(file).is_some()
}

/// The files in the folders in `folder` and below these, in the order of their names.
fn below(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|source| FormatError::io(folder, source))?;
    let mut entries: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    // Its clouds are those of the scans of a data set.
    entries.retain(|entry| !entry.ends_with("packed"));
    entries.sort();
    let mut files = Vec::new();
    for entry in entries {
        match entry.is_dir() && !entry.is_symlink() {
            true => files.extend(below(&entry)?),
            false => files.push(entry),
        }
    }
    Ok(files)
}

/// Notes and lists may lie beside sweeps.
fn keep_commonest_extension(files: &mut Vec<PathBuf>) {
    let count =
        |of: &PathBuf| files.iter().filter(|file| file.extension() == of.extension()).count();
    let commonest = files.iter().max_by_key(|file| count(file)).and_then(|file| file.extension());
    if let Some(commonest) = commonest.map(ToOwned::to_owned) {
        files.retain(|file| file.extension() == Some(&commonest));
    }
}

fn of_clusters(files: &[&PathBuf], points: &PointsArgs) -> anyhow::Result<Frame> {
    let (mut positions, mut values) = (Vec::new(), Vec::new());
    for (file, number) in files.iter().zip(0..) {
        positions.extend(points.read(file)?.positions);
        values.resize(positions.len(), number);
    }
    let labels = Labels { name: "cluster", values, names: None };
    let scan = Scan { positions, pose: Some(super::frame::IDENTITY), ..Scan::default() };
    Ok(Frame::of_scan(String::new(), scan, vec![labels]))
}

/// The turns of a capture, in the sensor's frame.
fn turns(file: &Path, points: &PointsArgs) -> anyhow::Result<Vec<Frame>> {
    let metadata = points.metadata.as_deref().map(ouster::Metadata::read).transpose()?;
    let mut senders = Senders::new(points.from);
    let mut scans = Vec::<Scan>::new();
    let (_, counts) = read_turns(file, metadata.as_ref(), &mut senders, |turned| {
        let number = turned.turn as usize;
        if number >= MOST_FRAMES {
            return ControlFlow::Break(());
        }
        if scans.len() <= number {
            scans.resize_with(number + 1, Scan::default);
        }
        let scan = &mut scans[number];
        scan.positions.push(turned.found.point_m);
        scan.range_m.get_or_insert_default().push(turned.found.range_m);
        scan.ring.get_or_insert_default().push(turned.found.ring);
        scan.time_s.get_or_insert_default().push(turned.time_s as f32);
        scan.reflectivity.get_or_insert_default().push(turned.found.reflectivity);
        ControlFlow::Continue(())
    })?;
    warn_of_packets(file, &senders, &counts);
    let frame = |(scan, turn): (Scan, u64)| {
        let name = format!("turn {turn}");
        Frame { turn: Some(turn), ..Frame::of_scan(name, scan, Vec::new()) }
    };
    Ok(scans.into_iter().zip(0..).map(frame).collect())
}
