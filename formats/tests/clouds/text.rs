use super::{error, read};
use formats::cloud_file::read_cloud;
use test_support::{need, shared_data};

const POINTS: [[f64; 3]; 2] = [[1.0, -2.5, 3e-7], [4.0, 5.0, 6.0]];

#[test]
fn columns_may_be_separated_in_any_usual_way() {
    for text in [
        "1 -2.5 3e-7\n4 5 6\n",
        "  1   -2.5 3e-7  \r\n\r\n4 5 6",
        "1,-2.5,3e-7\n4,5,6\n",
        "1, -2.5, 3e-7, 0.1, 0.2, 0.3\n4 , 5 , 6 , 0 , 0 , 1\n",
        "1;-2.5;3e-7\n4;5;6\n",
        "1\t-2.5\t3e-7\n4\t5\t6\n",
        "\"1\",\"-2.5\",\"3e-7\"\n\"4\",\"5\",\"6\"\n",
        "\u{feff}1 -2.5 3e-7\n4 5 6\n",
    ] {
        assert_eq!(read("a.txt", text), POINTS, "{text}");
    }
}

#[test]
fn a_line_of_names_says_which_columns_are_meant() {
    for text in [
        "x,y,z\n1,-2.5,3e-7\n4,5,6\n",
        "time,Z,intensity,Y,X\n9,3e-7,9,-2.5,1\n9,6,9,5,4\n",
        "\"x\";\"y\";\"z\"\n1;-2.5;3e-7\n4;5;6\n",
        // pandas' `to_csv`, with and without names.
        ",x,y,z\n0,1,-2.5,3e-7\n1,4,5,6\n",
        ",0,1,2,3\n0,1,-2.5,3e-7,9\n1,4,5,6,9\n",
        "easting northing height\n1 -2.5 3e-7\n4 5 6\n",
        "time,x_m,y_m,z_m\n9,1,-2.5,3e-7\n9,4,5,6\n",
        "ring,pos_x,pos_y,pos_z\n9,1,-2.5,3e-7\n9,4,5,6\n",
        "intensity,X_coord,Y_coord,Z_coord\n9,1,-2.5,3e-7\n9,4,5,6\n",
        "t,positionX,positionY,positionZ\n9,1,-2.5,3e-7\n9,4,5,6\n",
        "t,px,py,pz,nx,ny,nz\n9,1,-2.5,3e-7,0,0,1\n9,4,5,6,0,0,1\n",
        // CloudCompare, ParaView, VeloView, and ouster-sdk's `np.savetxt`.
        "//X Y Z Intensity\n1 -2.5 3e-7 9\n4 5 6 9\n",
        "\"intensity\",\"Points:0\",\"Points:1\",\"Points:2\"\n9,1,-2.5,3e-7\n9,4,5,6\n",
        "laser_id,Points_m_XYZ:0,Points_m_XYZ:1,Points_m_XYZ:2\n9,1,-2.5,3e-7\n9,4,5,6\n",
        "# TIMESTAMP (ns), RANGE (mm), X (m), Y (m), Z (m)\n9, 9, 1, -2.5, 3e-7\n9, 9, 4, 5, 6\n",
    ] {
        assert_eq!(read("a.csv", text), POINTS, "{text}");
    }
}

#[test]
fn names_of_columns_show_millimetres() {
    assert_eq!(read("a.csv", "t,X (mm),Y (mm),Z (mm)\n9,1000,-500,250\n"), [[1.0, -0.5, 0.25]]);
}

#[test]
fn numbers_of_lines_are_no_coordinates() {
    let rows = |first: usize, y: f64, last: &str| {
        (first..first + 9).map(|n| format!("{n} {y} 2 3{last}\n")).collect::<String>()
    };
    let cause = "columns: expected x, y and z, found numbers of the lines in the first column: leave \
                 it out, or name the columns in a first line, such as `n,x,y,z`";
    assert_eq!(error("a.xyz", rows(0, 0.5, "")), cause);
    assert_eq!(error("a.xyz", rows(1, 0.5, " 9")), cause);
    for text in [rows(2, 0.5, ""), rows(0, 1.0, ""), "x y z i\n".to_owned() + &rows(0, 0.5, "")] {
        assert_eq!(read("a.xyz", text).len(), 9);
    }
}

#[test]
fn decimal_commas_between_commas_are_named() {
    let rows = |row: &str| row.repeat(9);
    let cause = "columns: expected x, y and z, found pairs of whole numbers, probably with decimal \
                 commas: write decimal points, or semicolons between the columns";
    assert_eq!(error("a.csv", rows("1,250,-3,500,2,750\n")), cause);
    assert_eq!(error("a.csv", "x,y,z\n".to_owned() + &rows("1,250,-3,500,2,750\n")), cause);
    // Colours, or a point alone.
    for text in [rows("1,250,-3,50,2,7\n"), rows("1,250,-3,-50,2,70\n"), "1,25,3,50,2,75\n".into()]
    {
        assert!(!read("a.csv", text).is_empty());
    }
}

#[test]
fn comments_are_passed_over() {
    let text = "# x y z\n//X Y Z\n\n1 -2.5 3e-7 # the first\n   # another\n4 5 6\n";
    assert_eq!(read("a.xyz", text), POINTS);
    assert_eq!(read("a.xyz", b"# caf\xe9\n1 -2.5 3e-7\n4 5 6\n"), POINTS);
}

#[test]
fn a_count_before_the_points_is_checked() {
    for text in ["2\n1 -2.5 3e-7 -5 0 0 0\n4 5 6 -5 0 0 0\n", "\u{feff}1\n1 -2.5 3e-7\n1\n4 5 6\n"]
    {
        assert_eq!(read("a.pts", text), POINTS, "{text}");
    }
    assert!(read("a.pts", "0\n").is_empty());
    let path = need!(shared_data("bug_inputs/pts.pts"));
    let points = read_cloud(&path).unwrap();
    assert_eq!((points.len(), points[0]), (150, [17.204596, -0.666995, 7.418099]));
}

#[test]
fn no_points_are_a_cloud() {
    for text in ["", "\n\n", "# nothing\n", "x,y,z\n"] {
        assert!(read("a.csv", text).is_empty());
    }
}

#[test]
fn numbers_that_are_not_finite_are_passed_on() {
    let points = read("a.xyz", "nan inf -inf\n1e400 NaN -Infinity\n");
    assert!(points[0][0].is_nan() && points[1][1].is_nan());
    assert_eq!(points[0][1..], [f64::INFINITY, f64::NEG_INFINITY]);
    assert_eq!(points[1][0], f64::INFINITY);
}

#[test]
fn every_digit_of_f64_counts() {
    assert_eq!(read("a.xyz", "4500000.000000001 0.1 5e-324\n"), [[4500000.000000001, 0.1, 5e-324]]);
}

#[test]
fn long_lines_and_words_are_refused() {
    let long = format!("1 2 3\n{}", "1 ".repeat(600_000));
    assert_eq!(error("a.txt", long), "line 2: longer than 1048576 bytes");
    let word = format!("1 2 {}\x07", "9z".repeat(100));
    let message = error("a.txt", word);
    assert!(message.ends_with("…`") && message.len() < 100, "{message}");
}
