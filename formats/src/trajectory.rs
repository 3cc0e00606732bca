//! Trajectories: poses over time, read from text.
//!
//! | format | a line |
//! | --- | --- |
//! | TUM | time in seconds, x y z in metres, quaternion qx qy qz qw (<https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats>) |
//! | KITTI | twelve numbers, a 3 x 4 matrix row by row, without a time |
//!
//! Blanks separate numbers. Empty lines, lines that begin with `#` and a byte order mark are skipped.

use std::path::Path;

use glam::DQuat;

use crate::error::FormatError;
use crate::geometry::{Pose, Trajectory};
use crate::plausible::{or_foreign_file, read_text};

/// The time between poses in KITTI's format, which has no times: its sensor turns 10 times a second.
pub const KITTI_PERIOD_S: f64 = 0.1;

impl Trajectory {
    /// Reads a trajectory in TUM's or KITTI's format, which the count of numbers in a line tells apart.
    /// The poses of KITTI's format are [`KITTI_PERIOD_S`] apart and begin at 0.
    ///
    /// # Errors
    /// The file cannot be read; a line is no pose, or not after the one before; there is no pose.
    pub fn load(path: &Path) -> Result<Self, FormatError> {
        let poses = read(path).map_err(|error| or_foreign_file(path, "a trajectory", error))?;
        Ok(Self(poses))
    }
}

fn read(path: &Path) -> Result<Vec<(f64, Pose)>, FormatError> {
    let io = |source| FormatError::io(path, source);
    let text = read_text(path, u64::MAX).map_err(io)?;
    let flaw =
        |line: usize, cause: &str| Err(FormatError::malformed(path, format!("line {line}"), cause));
    let mut poses: Vec<(f64, Pose)> = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        if text.trim().is_empty() || text.trim_start().starts_with('#') {
            continue;
        }
        let (time_s, pose) = match pose_of(text, poses.len() as f64 * KITTI_PERIOD_S) {
            Ok(timed) => timed,
            Err(cause) => return flaw(line, &cause),
        };
        if let Some((before_s, _)) = poses.last().filter(|(before_s, _)| time_s <= *before_s) {
            return flaw(line, &format!("expected a time after {before_s} s, found {time_s} s"));
        }
        poses.push((time_s, pose));
    }
    if poses.is_empty() {
        return flaw(1, "expected a pose, found none in the file");
    }
    Ok(poses)
}

/// What is wrong with a word that is not a finite number.
fn not_a_number(word: &str) -> String {
    if word.contains([',', ';']) {
        return format!("expected numbers with blanks between them, found {word:?}");
    }
    let hint = if word.parse::<f64>().is_ok() {
        ": it must be finite"
    } else if word.starts_with(|c: char| c.is_alphabetic() || c == '_') {
        ": begin lines of names with `#`"
    } else {
        ""
    };
    format!("expected a number, found {word:?}{hint}")
}

fn pose_of(line: &str, at_s: f64) -> Result<(f64, Pose), String> {
    let numbers: Vec<f64> = line
        .split_whitespace()
        .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()).ok_or(word))
        .collect::<Result<_, _>>()
        .map_err(not_a_number)?;
    let (time_s, position_m, quaternion) = match numbers[..] {
        [time_s, x, y, z, qx, qy, qz, qw] => (time_s, [x, y, z], [qx, qy, qz, qw]),
        [a, b, c, x, d, e, f, y, g, h, i, z] => {
            (at_s, [x, y, z], quaternion_of([[a, b, c], [d, e, f], [g, h, i]])?)
        }
        _ => {
            let found = numbers.len();
            return Err(format!(
                "expected 8 numbers (time, x y z, qx qy qz qw) or 12 (a matrix), found {found}"
            ));
        }
    };
    let length = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
    // Some files have only six digits.
    if (length - 1.0).abs() > 1e-3 {
        return Err(format!("expected a quaternion of length 1, found length {length}"));
    }
    let rotation = DQuat::from_array(quaternion.map(|q| q / length));
    Ok((time_s, Pose { position_m: position_m.into(), rotation }))
}

/// Times of packets that are further outside of poses have none: a recording may begin and end
/// within a turn.
const TURN_S: f64 = 0.1;
/// From the start of Unix time to that of GPS time, less the leap seconds since (IS-GPS-200,
/// 20.3.3.5.2.4; 18 since 2017), and a week: seconds.
const UNIX_OF_GPS_S: f64 = 315_964_800.0 - 18.0;
const WEEK_S: f64 = 604_800.0;
/// TAI, the time of PTP's masters, less Unix time since 2017, seconds.
const TAI_S: f64 = 37.0;

/// Checks that poses whose first and last times are `known_s` cover the packets that were sent in
/// `sent_s`, Unix time in seconds. A single pose covers all times.
///
/// # Errors
/// Both spans, and what the times seem to be.
pub fn check_cover(known_s: [f64; 2], sent_s: [f64; 2]) -> Result<(), String> {
    let [first, last] = known_s;
    let cover =
        |shift: f64| first + shift <= sent_s[0] + TURN_S && sent_s[1] <= last + shift + TURN_S;
    if first == last || cover(0.0) {
        return Ok(());
    }
    let meet = |shift: f64, sent: f64| (first + shift - 1.0..=last + shift + 1.0).contains(&sent);
    let seem = |what: &str, shift: f64| format!("they seem to be {what}: add {shift} s to each");
    let clue = match first.abs() {
        1e17.. => "they seem to be nanoseconds: divide them by 1e9".to_owned(),
        1e14.. => "they seem to be microseconds: divide them by 1e6".to_owned(),
        1e11.. => "they seem to be milliseconds: divide them by 1e3".to_owned(),
        _ if meet(UNIX_OF_GPS_S, sent_s[0]) => seem("GPS time", UNIX_OF_GPS_S),
        _ if cover(-TAI_S) => seem("TAI, as of PTP", -TAI_S),
        ..1e8 if sent_s[0] > 1e8 => {
            let week_s = (sent_s[0] - UNIX_OF_GPS_S).rem_euclid(WEEK_S);
            match meet(0.0, week_s) {
                true => seem("seconds of a GPS week", sent_s[0] - week_s),
                false => "they seem to count from the start of a drive, as do KITTI's lines of 12 \
                          numbers, which have no times: add its Unix time to each"
                    .to_owned(),
            }
        }
        _ if sent_s[0] < 1e8 => "the packets seem to have no Unix times".to_owned(),
        _ if last < sent_s[0] || first > sent_s[1] => {
            "they seem to be of another clock or drive".to_owned()
        }
        _ => "they must cover all packets".to_owned(),
    };
    Err(format!(
        "expected poses from {:.3} s to {:.3} s, Unix time, when the packets were sent, found poses \
         from {first:.3} s to {last:.3} s; {clue}",
        sent_s[0], sent_s[1]
    ))
}

/// The rotation of the matrix with these rows, from the largest component of the quaternion
/// (Shepperd 1978).
fn quaternion_of(rows: [[f64; 3]; 3]) -> Result<[f64; 4], String> {
    let dot = |i: usize, j: usize| (0..3).map(|k| rows[i][k] * rows[j][k]).sum::<f64>();
    let [a, b, c] = rows;
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let is_rotation = (0..3)
        .all(|i| (dot(i, i) - 1.0).abs() < 1e-3 && (cross[i] - c[i]).abs() < 1e-3)
        && dot(0, 1).abs() < 1e-3;
    if !is_rotation {
        return Err("expected a rotation in the matrix, found another map".to_owned());
    }
    let [xx, yy, zz] = [a[0], b[1], c[2]];
    // Four times the square of each component.
    let squares = [1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz, 1.0 + xx + yy + zz];
    let largest = (0..4).max_by(|&i, &j| squares[i].total_cmp(&squares[j])).unwrap_or(3);
    let sums = [a[1] + b[0], a[2] + c[0], b[2] + c[1]];
    let differences = [c[1] - b[2], a[2] - c[0], b[0] - a[1]];
    let s = squares[largest];
    let quaternion = match largest {
        0 => [s, sums[0], sums[1], differences[0]],
        1 => [sums[0], s, sums[2], differences[1]],
        2 => [sums[1], sums[2], s, differences[2]],
        _ => [differences[0], differences[1], differences[2], s],
    };
    let length = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
    Ok(quaternion.map(|q| q / length))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn read(text: &str) -> Result<Trajectory, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let name = file.path().display().to_string();
        Trajectory::load(file.path()).map_err(|error| error.to_string().replace(&name, "f"))
    }

    #[test]
    fn both_formats_say_the_same() {
        // A third of a turn about (1, 1, 1), half a turn about z, and a tenth about x.
        let (sine, cosine) = (std::f64::consts::TAU / 10.0).sin_cos();
        let (sin_half, cos_half) = (std::f64::consts::TAU / 20.0).sin_cos();
        let tum = read(&format!(
            "\u{feff}# t p q\n0 1 2 3 0.5 0.5 0.5 0.5\n\n0.1 0 0 0 0 0 1 0\n0.2 0 0 0 {sin_half} 0 0 {cos_half}\n"
        ));
        let kitti = read(&format!(
            "0 0 1 1 1 0 0 2 0 1 0 3\n-1 0 0 0 0 -1 0 0 0 0 1 0\n1 0 0 0 0 {cosine} {} 0 0 {sine} {cosine} 0\n",
            -sine
        ));
        let (tum, kitti) = (tum.unwrap().0, kitti.unwrap().0);
        assert_eq!((tum.len(), kitti.len()), (3, 3));
        for ((at_s, a), (expected_s, b)) in tum.into_iter().zip(kitti) {
            assert!((at_s - expected_s).abs() < 1e-12 && a.position_m == b.position_m);
            assert!(a.rotation.abs_diff_eq(b.rotation, 1e-12), "{a:?} {b:?}");
        }
    }

    #[test]
    fn poses_are_interpolated_and_stay_beyond_their_ends() {
        let motion = read("# time x y z q\n1 0 0 0 0 0 0 1\n\n3 2 0 4 0 0 1 0\n").unwrap();
        let pose = motion.at(2.0);
        assert!(pose.position_m.distance(DVec3::new(1.0, 0.0, 2.0)) < 1e-12);
        assert!((pose.rotation * DVec3::X).distance(DVec3::Y) < 1e-12);
        assert_eq!(motion.at(-7.0).position_m, DVec3::ZERO);
        assert_eq!(motion.at(9.0).position_m, DVec3::new(2.0, 0.0, 4.0));
        assert_eq!(motion.known_s(), [1.0, 3.0]);
    }

    #[test]
    fn a_line_that_is_no_pose_is_named() {
        for (text, expected) in test_support::said::faults(include_str!("trajectory_faults.txt")) {
            assert_eq!(read(str::from_utf8(&text).unwrap()).unwrap_err(), expected);
        }
    }

    /// 2025-03-02T00:10:00 UTC is Unix time 1740874200 s, and, 18 leap seconds later, 618 s of week
    /// 2356 of GPS time.
    #[test]
    fn poses_that_do_not_cover_the_packets_are_refused_with_the_likely_cause() {
        let sent_s = [1_740_874_200.0, 1_740_874_260.0];
        let cover = |first: f64, last: f64| check_cover([first, last], sent_s);
        let [from, to] = sent_s;
        for [first, last] in [[from, to], [from + 0.09, to - 0.09], [0.0, 2e9], [7.0, 7.0]] {
            assert_eq!(cover(first, last), Ok(()));
        }
        let gps_s = f64::from(2356 * 7 * 86_400 + 618);
        let cases = [
            ([from * 1e9, to * 1e9], "nanoseconds: divide them by 1e9"),
            ([from * 1e6, to * 1e6], "microseconds: divide them by 1e6"),
            ([from * 1e3, to * 1e3], "milliseconds: divide them by 1e3"),
            ([gps_s, gps_s + 60.0], "GPS time: add 315964782 s to each"),
            ([618.0, 678.0], "seconds of a GPS week: add 1740873582 s to each"),
            ([from + 37.0, to + 37.0], "TAI, as of PTP: add -37 s to each"),
            ([0.0, 60.0], "count from the start of a drive, as do KITTI's"),
            ([from - 7200.0, to - 7200.0], "another clock or drive"),
            ([from, to - 10.0], "must cover all packets"),
            ([from + 10.0, to], "must cover all packets"),
        ];
        for ([first, last], clue) in cases {
            let cause = cover(first, last).unwrap_err();
            let start = format!(
                "expected poses from 1740874200.000 s to 1740874260.000 s, Unix time, when the \
                 packets were sent, found poses from {first:.3} s to {last:.3} s; they "
            );
            assert!(cause.starts_with(&start) && cause.contains(clue), "{cause}");
        }
        let cause = check_cover(sent_s, [0.0, 60.0]).unwrap_err();
        assert!(cause.ends_with("the packets seem to have no Unix times"), "{cause}");
    }
}
