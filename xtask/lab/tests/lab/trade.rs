//! `trade` and `report`: what was measured, and one page of everything.

use crate::{LAB, exits, succeeds};
use edgepuck_program::cli;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::Path;

fn lab() -> &'static Path {
    Path::new(LAB)
}

/// One shape of each class to train on and one to test with, in `shapes`.
fn shapes(at: &Path) {
    edgepuck_shapes::write_tree(&at.join("shapes"), 0, 1, 1).unwrap();
}

type Row = BTreeMap<String, String>;

fn rows(path: &Path) -> Vec<Row> {
    let mut csv = csv::Reader::from_path(path).unwrap();
    csv.deserialize().map(|row| row.unwrap()).collect()
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: `{}`", row[column]))
}

fn the<'a>(rows: &'a [Row], wanted: &[(&str, &str)]) -> &'a Row {
    let is_wanted = |row: &&Row| wanted.iter().all(|(column, value)| row[*column] == *value);
    rows.iter().find(is_wanted).unwrap_or_else(|| panic!("no row with {wanted:?}"))
}

/// A mesh of no class that a bundled model knows.
const TETRAHEDRON: &str = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n\
     3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";

/// One run for all that follows from it: it casts some million rays.
#[test]
fn the_chain_is_measured_advised_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    shapes(at);
    succeeds(lab(), at, "trade --quick --rounds 1 --meshes shapes --out assets/reports/trade");
    let record = at.join("assets/reports/trade/trade.csv");
    let rows = rows(&record);
    scans_are_as_true_as_they_claim(&rows);
    casters_differ_as_they_should(&rows);
    fp32_is_the_reference(&rows);

    let advise = |words: &str| {
        let given = ["edgepuck", "advise", "--record"].map(OsString::from);
        let record = OsString::from(&record);
        cli::main(given.into_iter().chain([record]).chain(words.split(' ').map(OsString::from)))
    };
    assert_eq!(advise("--device here --max-ms 1000"), 0);
    assert_eq!(advise("--device here --max-ms 1e-9"), 1);
    // A quick run does not model a Raspberry Pi.
    assert_eq!(advise("--device pi5 --max-ms 1000"), 1);

    succeeds(lab(), at, "report --assets assets --out page/report.html");
    let page = fs::read_to_string(at.join("page/report.html")).unwrap();
    assert!(page.contains("shapes-rotational-64") && page.contains("data-tip"));
    assert!(page.contains("cargo xtask ablate"), "what is missing is said");
}

fn scans_are_as_true_as_they_claim(rows: &[Row]) {
    let reference = the(rows, &[("part", "scan"), ("knob", "reference")]);
    assert_eq!(reference["agreement"], "1.0");
    let points = |row| number(row, "points_per_scan");
    let eight = the(rows, &[("sensor", "vlp32c, 8 beams")]);
    assert!((0.15..0.35).contains(&(points(eight) / points(reference))), "a fourth of the beams");
    let noise = |noise_m| the(rows, &[("part", "scan"), ("knob", "noise"), ("noise_m", noise_m)]);
    // Without noise what is left is f32's rounding of 2 to 4 m: 2^-23 m.
    assert!(number(noise("0.0"), "range_worst_m") < 2f64.powi(-22));
    // Of n > 10^4 draws the sample's sigma is off by 1/sqrt(2n) < 0.7 %; four of those.
    assert!((number(noise("0.1"), "range_rms_m") / 0.1 - 1.0).abs() < 0.03);
}

fn casters_differ_as_they_should(rows: &[Row]) {
    let cpu = the(rows, &[("caster", "cpu f32 watertight, f64 range"), ("part", "caster")]);
    assert_eq!(number(cpu, "wrong_rays_per_million"), 0.0);
    // The triangle is the oracle's; what is left is f64's rounding of 2 to 4 m, 2^-51 m,
    // which slopes of up to 10^3 amplify.
    assert!(number(cpu, "range_worst_m") < 1e-12);
    let f32 = the(rows, &[("caster", "cpu f32 watertight, f32 range"), ("culling", "on")]);
    assert!(number(f32, "range_worst_m") > 0.0);
}

fn fp32_is_the_reference(rows: &[Row]) {
    let of = |precision| the(rows, &[("part", "classifier"), ("precision", precision)]);
    assert_eq!((number(of("f32"), "logit_error"), number(of("f32"), "agreement")), (0.0, 1.0));
    assert!(number(of("i8"), "logit_error") > 0.0);
    assert!(number(of("i8"), "megabytes") < 0.5 * number(of("f32"), "megabytes"));
}

#[test]
fn what_cannot_be_used_is_named_before_anything_is_scanned_or_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    shapes(at);
    fs::create_dir(at.join("empty")).unwrap();
    fs::write(at.join("clouds.npz"), "no clouds").unwrap();
    for class in ["yak", "zebra"] {
        let test = at.join("animals").join(class).join("test");
        fs::create_dir_all(&test).unwrap();
        fs::write(test.join(format!("{class}.off")), TETRAHEDRON).unwrap();
    }
    for (code, words, expected) in [
        (2, "trade --meshes nowhere", "expected a folder, found nowhere"),
        (1, "trade --meshes empty", "empty"),
        (1, "trade --quick --meshes shapes --clouds clouds.npz", "clouds.npz"),
        (1, "trade --quick --meshes animals", "no bundled model knows the classes"),
        (1, "report --assets gone", "--assets: expected a folder, found gone"),
    ] {
        let refused = exits(code, lab(), at, &format!("{words} --out out"));
        assert!(refused.contains(expected), "{words}: {refused}");
        assert!(!refused.contains("reference:"), "{words}: it scanned: {refused}");
        assert!(!at.join("out").exists(), "{words}");
    }
}
