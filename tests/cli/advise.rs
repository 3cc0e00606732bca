//! `advise`: one configuration, chosen from measurements.

use crate::Folder;

#[test]
fn the_record_is_advised_from_in_any_folder() {
    let folder = Folder::new();
    let advised = folder.succeeds("advise --device pi5 --max-ms 5 --min-accuracy 0.85");
    assert!(advised.contains("infer-cpu classify --model"), "{advised}");
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
