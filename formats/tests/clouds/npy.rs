use super::{MANY, error, read};
use crate::numpy::npy;
use formats::cloud_file::read_cloud;
use proptest::prelude::*;
use test_support::{need, shared_data};

fn c_order(descr: &str, shape: &str, data: &[u8]) -> Vec<[f64; 3]> {
    read("a.npy", npy(descr, "False", shape, data))
}

#[test]
fn numbers_of_every_type_are_read() {
    macro_rules! of {
        ($number:ty, $order:ident) => {
            [1, 2, 3].map(|i| (i as $number).$order()).as_flattened().to_vec()
        };
    }
    for (descr, data) in [
        ("|i1", of!(i8, to_le_bytes)),
        ("|u1", of!(u8, to_le_bytes)),
        ("<i2", of!(i16, to_le_bytes)),
        (">i2", of!(i16, to_be_bytes)),
        ("<u2", of!(u16, to_le_bytes)),
        ("<i4", of!(i32, to_le_bytes)),
        (">u4", of!(u32, to_be_bytes)),
        ("<i8", of!(i64, to_le_bytes)),
        ("<u8", of!(u64, to_le_bytes)),
        ("<f2", vec![0, 0x3c, 0, 0x40, 0, 0x42]),
        (">f2", vec![0x3c, 0, 0x40, 0, 0x42, 0]),
        ("<f4", of!(f32, to_le_bytes)),
        (">f4", of!(f32, to_be_bytes)),
        ("<f8", of!(f64, to_le_bytes)),
        (">f8", of!(f64, to_be_bytes)),
    ] {
        assert_eq!(c_order(descr, "(1, 3)", &data), [[1.0, 2.0, 3.0]], "{descr}");
    }
}

#[test]
fn columns_beyond_the_third_are_passed_over() {
    let data = [1, 2, 3, 9, 4, 5, 6, 9];
    assert_eq!(c_order("|u1", "(2, 4)", &data), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    let data = [1, 4, 2, 5, 3, 6, 9, 9];
    let points = read("a.npy", npy("|u1", "True", "(2, 4)", &data));
    assert_eq!(points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert!(c_order("<f4", "(0, 3)", &[]).is_empty());
}

/// Types by `numpy.lib.format`, with the padding of `numpy.dtype(..., align=True)`.
#[test]
fn records_have_their_coordinates_by_name() {
    let record = |types: &str, shape: &str, data: &[u8]| {
        let quoted = npy("*", "False", shape, data);
        // The header's list has no quotes around it.
        let text = String::from_utf8_lossy(&quoted[10..10 + quoted[8] as usize]).into_owned();
        let text = text.replace("'*'", types);
        let length = (text.len() as u16).to_le_bytes();
        [&quoted[..8], &length, text.as_bytes(), data].concat()
    };
    let types = "[('i', '|u1'), ('', '|V3'), ('Z', '>f8'), ('tag', '<U2'), (('east', 'x'), '<f4'), \
                 ('s', '<i2', (2,)), ('y', '<i2')]";
    let point = |x: f32, y: i16, z: f64| {
        [&[9; 4][..], &z.to_be_bytes(), &[9; 8], &x.to_le_bytes(), &[9; 4], &y.to_le_bytes()]
            .concat()
    };
    let data = [point(1.0, 2, 3.0), point(4.0, 5, 6.0)].concat();
    for shape in ["(2,)", "(1, 2)"] {
        let points = read("a.npy", record(types, shape, &data));
        assert_eq!(points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    }
    assert_eq!(
        read("a.npz", crate::numpy::npz(&[("a", record(types, "(2,)", &data))]))[1],
        [4.0, 5.0, 6.0]
    );
    let refuse = |types: &str| error("a.npy", record(types, "(1,)", &[0; 12]));
    let expected =
        |found| format!("array: expected records with numbers x, y and z, found {found}");
    for types in [
        "[('x', '<f4'), ('y', '<f4')]",
        "[('x', '|O'), ('y', '<f4'), ('z', '<f4')]",
        "[('x', '<f4', (2,)), ('y', '<f4'), ('z', '<f4')]",
    ] {
        assert_eq!(refuse(types), expected(types));
    }
    let xyz = "[('x', '<f4'), ('y', '<f4'), ('z', '<f4')]";
    let cut = error("a.npy", record(xyz, &format!("({MANY},)"), &[0; 20]));
    assert_eq!(cut, format!("array: the file ends after 1 of {MANY}"));
    let path = need!(shared_data("bug_inputs/struct.npy"));
    let points = read_cloud(&path).unwrap();
    assert!(points.len() == 150 && points[0].iter().all(|x| x.abs() < 100.0), "{:?}", points[0]);
}

#[test]
fn malformed_files_are_refused() {
    let wrong = |descr, shape: &str, data: &[u8]| error("a.npy", npy(descr, "False", shape, data));
    let shape = |found: &str| format!("array: expected shape [n, 3], found {found}");
    assert_eq!(wrong("<f4", "(3,)", &[0; 12]), shape("[3]"));
    assert_eq!(wrong("<f4", "(4, 2)", &[0; 32]), shape("[4, 2]"));
    assert_eq!(
        wrong("<f4", "(2, 1, 3)", &[0; 24]),
        shape("2 clouds of 1 points: `edgepuck eval` classifies packed sets")
    );
    let transposed = wrong("<f4", "(3, 100)", &[0; 1200]);
    assert_eq!(transposed, shape("[3, 100]: transpose it"));
    assert_eq!(
        wrong("<c8", "(1, 3)", &[0; 24]),
        "array: expected numbers, found elements of type `<c8`"
    );
    assert_eq!(
        wrong("|O", "(1, 3)", &[0; 24]),
        "array: expected numbers, found pickled Python objects"
    );
    assert_eq!(wrong("<f4", "(3, 3)", &[0; 35]), "array: the file ends after 2 of 3");
    assert_eq!(error("a.npy", ""), "header: failed to fill whole buffer");
    assert_eq!(error("a.npy", "no array"), "header: expected a NumPy array");
    let negative = npy("<f4", "False", "(-1, 3)", &[]);
    assert!(error("a.npy", negative).starts_with(
        "header: expected a dictionary with descr, fortran_order and shape, found {'descr'"
    ));
}

#[test]
fn a_promise_beyond_all_memory_is_an_error() {
    for (order, shape) in [("False", format!("({MANY}, 3)")), ("True", format!("({MANY}, 3)"))] {
        let message = error("a.npy", npy("<f8", order, &shape, &[0; 48]));
        assert!(message.starts_with("array: the file ends after "), "{message}");
    }
    let wide = npy("<f8", "False", &format!("(1, {MANY})"), &[0; 48]);
    assert_eq!(
        error("a.npy", wide),
        "array: expected points of 1 to 16777216 bytes, found 8000000000000000000"
    );
}

proptest! {
    #[test]
    fn either_order_gives_the_same_points(
        points in prop::collection::vec(prop::array::uniform3(-1e9f64..1e9), 0..50),
    ) {
        let shape = format!("({}, 3)", points.len());
        let bytes = |at: &dyn Fn(usize) -> f64| -> Vec<u8> {
            (0..points.len() * 3).flat_map(|i| at(i).to_le_bytes()).collect()
        };
        let rows = bytes(&|i| points[i / 3][i % 3]);
        let columns = bytes(&|i| points[i % points.len()][i / points.len()]);
        prop_assert_eq!(&c_order("<f8", &shape, &rows), &points);
        prop_assert_eq!(&read("a.npy", npy("<f8", "True", &shape, &columns)), &points);
    }
}
