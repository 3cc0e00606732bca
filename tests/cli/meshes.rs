use crate::Folder;
use std::fmt::Write;

/// Writes nine tori with different thicknesses in three classes to `meshes`, in ModelNet's layout.
pub fn write_tree(folder: &Folder) {
    for (class, thickness) in [("ring", 0.1), ("donut", 0.3), ("ball", 0.6)] {
        for (i, split) in [(1, "train"), (2, "train"), (3, "test")] {
            let file = format!("meshes/{class}/{split}/{class}_{i:04}.off");
            folder.write(&file, off(8 + 8 * i, thickness));
        }
    }
}

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
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        writeln!(text, "4 {a} {b} {c} {d}").unwrap();
    }
    text
}
