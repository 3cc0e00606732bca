//! `advise`: one configuration, chosen from measurements.

use crate::Folder;
use std::fs;

#[test]
fn the_record_that_ships_is_advised_from_in_any_folder() {
    let advised = Folder::new().succeeds("advise --device pi5 --max-ms 5 --min-accuracy 0.85");
    assert!(advised.contains("infer-cpu classify --model"), "{advised}");
}

#[test]
fn bad_records_and_limits_are_named() {
    let folder = Folder::new();
    folder.write("a.csv", "part,points\nscan,1\n");
    folder.write("empty.csv", "");
    fs::create_dir(folder.at("folder")).unwrap();
    for (record, cause) in [
        ("a.csv", "expected a record"),
        ("no.csv", "cannot read"),
        ("folder", "cannot read"),
        ("empty.csv", "found no rows"),
    ] {
        let refused = folder.exits(1, &format!("advise --device pi5 --max-ms 5 --record {record}"));
        assert!(refused.contains(record) && refused.contains(cause), "{refused}");
    }
    folder.refuses(
        2,
        &[
            ("advise --device pi5", ""),
            ("advise --device pi5 --max-ms NaN", ""),
            ("advise --device toaster --max-ms 5", ""),
            ("advise --device pi5 --max-ms -1", "--max-ms"),
        ],
    );
}
