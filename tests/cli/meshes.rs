//! Small meshes to scan.

use std::fmt::Write;
use std::path::Path;

/// Nine tori of different thickness in three classes, as OFF, OBJ and OFF in a
/// ModelNet tree.
pub fn write_tree(folder: &Path) {
    for (class, thickness) in [("ring", 0.1), ("donut", 0.3), ("ball", 0.6)] {
        for (i, split) in [(1, "train"), (2, "train"), (3, "test")] {
            let folder = folder.join(class).join(split);
            std::fs::create_dir_all(&folder).unwrap();
            let segments = 8 + 8 * i;
            let text = off(segments, thickness);
            std::fs::write(folder.join(format!("{class}_{i:04}.off")), text).unwrap();
        }
    }
}

/// A torus with `segments` x `segments` quads, as OFF.
pub fn off(segments: usize, thickness: f64) -> String {
    let n = segments;
    let mut text = format!("OFF\n{} {} 0\n", n * n, n * n);
    let angle = |i: usize| i as f64 / n as f64 * std::f64::consts::TAU;
    for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
        let radius = 1.0 + thickness * angle(j).cos();
        let (x, y) = (radius * angle(i).cos(), radius * angle(i).sin());
        writeln!(text, "{x} {y} {}", thickness * angle(j).sin()).unwrap();
    }
    for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
        let at = |i: usize, j: usize| (i % n) * n + j % n;
        let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        let [a, b, c, d] = corners;
        writeln!(text, "4 {a} {b} {c} {d}").unwrap();
    }
    text
}
