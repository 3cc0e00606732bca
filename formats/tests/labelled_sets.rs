use std::fs;

use formats::labelled::{LabelledSet, read_labelled};

use crate::numpy::{npy, npz};

/// An array as NumPy writes it: key, type, shape, data.
type Array<'a> = (&'a str, &'a str, &'a str, &'a [u8]);

fn read(arrays: &[Array<'_>]) -> Result<LabelledSet, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.npz");
    let arrays = arrays.iter().map(|(key, descr, shape, data)| {
        let array = npy(descr, "False", shape, data);
        (*key, array)
    });
    fs::write(&path, npz(&arrays.collect::<Vec<_>>())).unwrap();
    read_labelled(&path).map_err(|error| {
        let message = error.to_string();
        message.split_once("set.npz: ").unwrap().1.to_owned()
    })
}

/// Two clouds of one point: 32767, 0, -32767 and 1, 2, 3.
const I16: Array<'_> =
    ("points_i16", "<i2", "(2, 1, 3)", &[0xff, 0x7f, 0, 0, 1, 0x80, 1, 0, 2, 0, 3, 0]);
/// The same in f16, unscaled.
const F16: Array<'_> =
    ("points", "<f2", "(2, 1, 3)", &[0, 0x3c, 0, 0, 0, 0xbc, 0, 0x3c, 0, 0x40, 0, 0x42]);
const LABELS: Array<'_> = ("labels", "|u1", "(2,)", &[1, 0]);

#[test]
fn scaled_whole_numbers_are_read_as_numpy_divides_them() {
    let names = ("names", "|S3", "(2,)", &b"cupjar"[..]);
    let classes = ("classes", "<U1", "(2,)", &b"a\0\0\0\xe9\0\0\0"[..]);
    let set = read(&[I16, LABELS, names, classes]).unwrap();
    assert_eq!((set.len(), set.smallest_cloud()), (2, 1));
    assert_eq!(set.cloud(0), [[1.0, 0.0, -1.0]]);
    assert_eq!(set.cloud(1), [[1.0 / 32767.0, 2.0 / 32767.0, 3.0 / 32767.0]]);
    assert_eq!(set.labels, [1, 0]);
    assert_eq!(set.names.unwrap(), ["cup", "jar"]);
    assert_eq!(set.classes.unwrap(), ["a", "é"]);
}

/// Three points in two clouds, 1 and 2.
const RAGGED: Array<'_> = (
    "points",
    "<f2",
    "(3, 3)",
    &[0, 0x3c, 0, 0, 0, 0xbc, 0, 0x3c, 0, 0x40, 0, 0x42, 0, 0, 0, 0, 0, 0],
);
const OFFSETS: Array<'_> = ("offsets", "|u1", "(3,)", &[0, 1, 3]);

#[test]
fn clusters_of_any_size_have_offsets_and_labels_that_may_be_names() {
    let labels = ("labels", "|S4", "(2,)", &b"tree\x63ar\0"[..]);
    let range = ("range_m", "<f2", "(2,)", &[0, 0x3c, 0, 0x7e][..]);
    let ids = ("ids", "|S3", "(2,)", &b"0#10#2"[..]);
    let set = read(&[RAGGED, OFFSETS, labels, range, ids]).unwrap();
    assert_eq!((set.len(), set.smallest_cloud()), (2, 1));
    assert_eq!(set.cloud(0), [[1.0, 0.0, -1.0]]);
    assert_eq!(set.cloud(1), [[1.0, 2.0, 3.0], [0.0; 3]]);
    assert_eq!(set.classes.as_ref().unwrap()[..], ["car", "tree"], "sorted");
    assert_eq!(set.labels, [1, 0]);
    let range = set.range_m.as_ref().unwrap();
    assert!(range[0] == 1.0 && range[1].is_nan(), "{range:?}");
    assert_eq!(set.ids.as_ref().unwrap()[..], ["0#1", "0#2"]);
    let turned = set.select(&[1, 0, 1]);
    assert_eq!(turned.ids.as_ref().unwrap()[..], ["0#2", "0#1", "0#2"]);
    assert_eq!((turned.offsets.as_slice(), turned.cloud(2)), (&[0, 2, 3, 5][..], set.cloud(1)));
    let classes = ("classes", "|S4", "(3,)", &b"bus\0tree\x63ar\0"[..]);
    assert_eq!(read(&[RAGGED, OFFSETS, labels, classes]).unwrap().labels, [1, 2]);
}

/// A cluster in another frame than its sensor's is moved there: directions and ranges
/// are from the sensor.
#[test]
fn points_are_counted_from_where_the_sensor_was() {
    let labels = ("labels", "|u1", "(2,)", &[0, 1][..]);
    // 1, 0, 2 for both; then that and 0, 0, 1.
    let one = ("sensor_origin", "<f2", "(3,)", &[0, 0x3c, 0, 0, 0, 0x40][..]);
    let each =
        ("sensor_origin", "<f2", "(2, 3)", &[0, 0x3c, 0, 0, 0, 0x40, 0, 0, 0, 0, 0, 0x3c][..]);
    let set = read(&[RAGGED, OFFSETS, labels, one]).unwrap();
    assert_eq!(set.cloud(0), [[0.0, 0.0, -3.0]]);
    assert_eq!(set.cloud(1), [[0.0, 2.0, 1.0], [-1.0, 0.0, -2.0]]);
    let set = read(&[RAGGED, OFFSETS, labels, each]).unwrap();
    assert_eq!(set.cloud(1), [[1.0, 2.0, 2.0], [0.0, 0.0, -1.0]]);
    let wrong = ("sensor_origin", "<f2", "(1,)", &[0, 0][..]);
    let error = read(&[RAGGED, OFFSETS, labels, wrong]).unwrap_err().to_string();
    assert!(error.ends_with("sensor_origin: expected shape [3] or [2, 3], found [1]"), "{error}");
}

/// What other programs keep beside clouds of one size is not looked at.
#[test]
fn clouds_of_one_size_have_no_remarks() {
    let ids = ("ids", "<i8", "(1,)", &[7, 0, 0, 0, 0, 0, 0, 0][..]);
    let set = read(&[F16, LABELS, OFFSETS, ids]).unwrap();
    assert_eq!((set.offsets.as_slice(), set.ids), (&[0, 1, 2][..], None));
}

#[test]
fn names_and_classes_may_be_absent_and_labels_of_any_type() {
    for labels in [
        LABELS,
        ("labels", "<i8", "(2, 1)", &[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]),
        ("labels", ">u2", "(2,)", &[0, 1, 0, 0]),
    ] {
        let set = read(&[F16, labels]).unwrap();
        assert_eq!(set.cloud(0), [[1.0, 0.0, -1.0]]);
        assert_eq!(set.labels, [1, 0]);
        assert_eq!((set.names, set.classes), (None, None));
    }
}

#[test]
fn malformed_sets_are_refused_with_their_key() {
    let refused = |arrays: &[Array<'_>], message: &str| {
        assert_eq!(read(arrays).unwrap_err(), message);
    };
    for (descr, shape, data, message) in [
        ("|u1", "(3,)", &[0; 3][..], "expected 2 values, one for each cloud, found 3"),
        ("|i1", "(2,)", &[0, 0xff], "expected whole numbers from 0, found -1"),
        ("<f2", "(2,)", &[0, 0x38, 0, 0], "expected whole numbers from 0, found 0.5"),
        ("|u1", "(1, 2)", &[0; 2], "expected shape [m], found [1, 2]"),
    ] {
        let labels = ("labels", descr, shape, data);
        refused(&[F16, labels], &format!("labels: {message}"));
    }
    for (descr, shape, data, message) in [
        ("|u1", "(3,)", &[1, 1, 3][..], "expected 0 first, found 1"),
        ("|u1", "(0,)", &[], "expected 0 first, found none"),
        ("|u1", "(3,)", &[0, 1, 4], "expected 3 last, found 4"),
        ("|u1", "(4,)", &[0, 2, 1, 3], "expected values that ascend, found 1 after 2"),
        ("|i1", "(3,)", &[0, 0xff, 3], "expected whole numbers from 0, found -1"),
    ] {
        let offsets = ("offsets", descr, shape, data);
        refused(&[RAGGED, offsets, LABELS], &format!("offsets: {message}"));
    }
    let one = "expected 2 values, one for each cloud, found 1";
    for (sets, key, descr, data) in [
        (&[F16, LABELS][..], "names", "|S1", &b"a"[..]),
        (&[F16, LABELS], "n_raw", "<i8", &[7, 0, 0, 0, 0, 0, 0, 0]),
        (&[RAGGED, OFFSETS, LABELS], "sensor", "|S1", b"a"),
    ] {
        refused(&[sets, &[(key, descr, "(1,)", data)]].concat(), &format!("{key}: {one}"));
    }
    for (points, message) in [
        (
            ("points", "<i2", "(2, 1, 3)", I16.3),
            "expected elements of type f2, f4 or f8, found <i2",
        ),
        (("points", "<f2", "(2, 3)", F16.3), "expected shape [m, n, 3], found [2, 3]"),
        (RAGGED, "expected shape [m, n, 3], found [3, 3]"),
        (
            ("points", "<f2", "(1000000000000000000, 1, 3)", F16.3),
            "the file ends after 6 of 3000000000000000000",
        ),
    ] {
        refused(&[points, LABELS], &format!("points: {message}"));
    }
    let flat = ("points", "<f2", "(9,)", RAGGED.3);
    refused(&[flat, OFFSETS, LABELS], "points: expected shape [total, 3], found [9]");
    let packed = "points: expected a packed set of labelled clouds, found the keys [labels]";
    refused(&[LABELS], packed);
    refused(&[I16], "labels: missing");
    let objects = ("names", "|O", "(2,)", &b"ab"[..]);
    refused(&[F16, LABELS, objects], "names: expected a list of text, found |O of shape [2]");
    let classes = ("classes", "|S1", "(1,)", &b"a"[..]);
    refused(&[F16, LABELS, classes], "labels: expected labels below 1, found 1");
    let words = ("labels", "|S1", "(2,)", &b"ab"[..]);
    refused(&[F16, words, classes], "labels: expected one of the classes, found `b`");
    let short = ("offsets", "|u1", "(2,)", &[0, 3][..]);
    let message = "labels: expected 1 values, one for each cloud, found 2";
    refused(&[RAGGED, short, LABELS], message);
}
