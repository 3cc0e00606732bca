//! `advise`: one configuration out of what was measured.

use crate::{exits, said, succeeds};
use std::fs;

#[test]
fn the_record_that_ships_is_advised_from_in_any_folder() {
    let folder = tempfile::tempdir().unwrap();
    let advice = "advise --device pi5 --max-ms 5 --min-accuracy 0.85";
    let advised = said(&succeeds(folder.path(), advice));
    assert!(advised.contains("infer-cpu classify --model"), "{advised}");
}

#[test]
fn bad_records_and_limits_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("a.csv"), "part,points\nscan,1\n").unwrap();
    fs::write(at.join("empty.csv"), "").unwrap();
    fs::create_dir(at.join("folder")).unwrap();
    for (record, cause) in [
        ("a.csv", "expected a record"),
        ("no.csv", "cannot read"),
        ("folder", "cannot read"),
        ("empty.csv", "found no rows"),
    ] {
        let refused = exits(1, at, &format!("advise --device pi5 --max-ms 5 --record {record}"));
        assert!(refused.contains(record) && refused.contains(cause), "{refused}");
    }
    exits(2, at, "advise --device pi5");
    exits(2, at, "advise --device pi5 --max-ms NaN");
    exits(2, at, "advise --device toaster --max-ms 5");
    assert!(exits(2, at, "advise --device pi5 --max-ms -1").contains("--max-ms"));
}
