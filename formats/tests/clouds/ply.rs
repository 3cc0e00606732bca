use super::{MANY, error, read};

const POINTS: [[f64; 3]; 2] = [[0.5, -2.0, 3.0], [4.0, 5.0, 6.0]];

fn ply(format: &str, header: &str, data: &[u8]) -> Vec<u8> {
    let start = format!("ply\nformat {format} 1.0\ncomment made by hand\n{header}end_header\n");
    [start.as_bytes(), data].concat()
}

const BUSY: &str = "element camera 2\nproperty list uchar float pose\nproperty int id\n\
                    element tag 2\nproperty short tag\n\
                    element vertex 2\nproperty uchar red\nproperty double z\n\
                    property list uchar int neighbours\nproperty short y\nproperty float x\n\
                    element strip 1\nproperty list uchar int vertex_indices\n";

#[test]
fn text_is_read_by_its_properties() {
    let data = b"2 0.5 0.5 7\n0 7\n-1\n-1\n255 3 2 8 9 -2 .5\n255 6. 0 5 4\n3 0 1 1\n";
    assert_eq!(read("a.ply", ply("ascii", BUSY, data)), POINTS);
    let crlf = String::from_utf8(ply("ascii", BUSY, data)).unwrap().replace('\n', "\r\n");
    assert_eq!(read("a.ply", crlf), POINTS);
    let marked = [b"\xef\xbb\xbf", &ply("ascii", BUSY, data)[..]].concat();
    assert_eq!(read("a.ply", marked), POINTS);
    let upper = ["float z", "short y", "float x"];
    let upper = upper.iter().fold(BUSY.replace("double z", "float Z"), |header, name| {
        header.replace(
            name,
            &format!("{}{}", &name[..name.len() - 1], name[name.len() - 1..].to_uppercase()),
        )
    });
    assert_eq!(read("a.ply", ply("ascii", &upper, data)), POINTS);
}

#[test]
fn either_byte_order_is_read() {
    macro_rules! data {
        ($bytes:ident) => {
            [
                &[2][..],
                &0.5f32.$bytes(),
                &0.5f32.$bytes(),
                &7i32.$bytes(),
                &[0],
                &7i32.$bytes(),
                &[9; 4],
                &[255],
                &3f64.$bytes(),
                &[2],
                &8i32.$bytes(),
                &9i32.$bytes(),
                &(-2i16).$bytes(),
                &0.5f32.$bytes(),
                &[255],
                &6f64.$bytes(),
                &[0],
                &5i16.$bytes(),
                &4f32.$bytes(),
                &[3],
            ]
            .concat()
        };
    }
    let little = ply("binary_little_endian", BUSY, &data!(to_le_bytes));
    assert_eq!(read("a.ply", little), POINTS);
    assert_eq!(read("a.ply", ply("binary_big_endian", BUSY, &data!(to_be_bytes))), POINTS);
}

#[test]
fn coordinates_may_be_of_any_type() {
    for (number, data) in [
        ("char", vec![1, 2, 3]),
        ("uint8", vec![1, 2, 3]),
        ("ushort", vec![1, 0, 2, 0, 3, 0]),
        ("int32", vec![1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0]),
        ("float64", [1.0f64, 2.0, 3.0].map(f64::to_le_bytes).concat()),
    ] {
        let axes = ["x", "y", "z"].map(|axis| format!("property {number} {axis}\n")).concat();
        let header = format!("element vertex 1\n{axes}");
        let points = read("a.ply", ply("binary_little_endian", &header, &data));
        assert_eq!(points, [[1.0, 2.0, 3.0]], "{number}");
    }
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

#[test]
fn text_keeps_every_digit_and_what_is_not_finite() {
    let header = format!("element vertex 2\n{XYZ}");
    let points = read("a.ply", ply("ascii", &header, b"4500000.1 0.1 -inf\nnan 0 0\n"));
    assert_eq!(points[0], [4_500_000.1, 0.1, f64::NEG_INFINITY]);
    assert!(points[1][0].is_nan());
}

#[test]
fn no_vertices_are_a_cloud() {
    for format in ["ascii", "binary_little_endian"] {
        assert!(read("a.ply", ply(format, &format!("element vertex 0\n{XYZ}"), b"")).is_empty());
    }
}

#[test]
fn faults_of_binary_files_are_named() {
    let vertices = |faces: usize, size: usize| {
        let header =
            format!("element vertex 2\n{XYZ}element face {faces}\nproperty list char int v\n");
        ply("binary_little_endian", &header, &vec![0; size])
    };
    assert_eq!(read("a.ply", vertices(0, 35)).len(), 2);
    let more = error("a.ply", vertices(0, 36));
    assert_eq!(more, "element vertex: expected 2 by the header, found 3");
    let mesh = error("a.ply", vertices(1, 29));
    assert_eq!(mesh, "element face: expected a cloud, found a mesh: scan it first");
    let list = format!("element vertex 1\nproperty list char int n\n{XYZ}");
    let negative = ply("binary_big_endian", &list, &[0xff; 40]);
    assert_eq!(error("a.ply", negative), "element vertex: the list n has length -1");
}

#[test]
fn a_promise_beyond_all_memory_is_an_error() {
    let ends = |found| format!("the file ends after {found} of {MANY}");
    let vertices = format!("element vertex {MANY}\n{XYZ}");
    let binary = error("a.ply", ply("binary_little_endian", &vertices, &[0; 30]));
    assert_eq!(binary, format!("element vertex: {}", ends(2)));
    let ascii = error("a.ply", ply("ascii", &vertices, b"1 2 3\n"));
    assert_eq!(ascii, format!("line 10: {}", ends(1)));
    let lists = format!("element vertex {MANY}\nproperty list uint double n\n{XYZ}");
    let lists = error("a.ply", ply("binary_little_endian", &lists, &[0; 40]));
    assert_eq!(lists, format!("element vertex: {}", ends(2)));
    let long = format!("element vertex 1\nproperty list uint double n\n{XYZ}");
    let long = error("a.ply", ply("binary_little_endian", &long, &[0xff; 40]));
    assert_eq!(long, "element vertex: the file ends after 0 of 1");
    let empty = format!("element nothing {MANY}\nelement vertex 1\n{XYZ}");
    assert_eq!(read("a.ply", ply("ascii", &empty, b"1 2 3\n")), [[1.0, 2.0, 3.0]]);
    let before = format!("element other {MANY}\nproperty double d\nelement vertex 1\n{XYZ}");
    let before = error("a.ply", ply("binary_little_endian", &before, &[0; 40]));
    assert_eq!(before, format!("element other: {}", ends(5)));
}
