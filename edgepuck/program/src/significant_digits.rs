//! Numbers rounded to significant digits.

/// `x` with three significant digits.
pub fn digits(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e6).contains(&size) => format!("{x:.2e}"),
        size if size < 10.0 => format!("{x:.3}").trim_end_matches('0').trim_end_matches('.').into(),
        size if size < 100.0 => format!("{x:.1}"),
        _ => format!("{x:.0}"),
    }
}
