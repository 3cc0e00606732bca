//! Clouds as text, with a line for each point.
//!
//! Semicolons, commas, tabs or blanks separate columns: the first of these that the first line has, and
//! tabs rather than the commas between them. A first line of names, which may be a comment, states the
//! columns of x, y and z, their unit if that is not the metre, and the columns of intensities and rings;
//! without names they are the first three, and where pandas numbers the columns, those after the nameless one.
//! Text after a `#`, and a line that begins with `//`, is a comment. A line with nothing but a count is
//! that of the points after it, as in Leica's `.pts`.

use std::io::{self, BufRead, Write};
use std::path::Path;

use super::Cloud;
use super::columns::{self, Extra, Rows};
use crate::decoding::excerpt;
use crate::error::FormatError;
use crate::lines::{Line, Lines};

const AXES: [&str; 3] = ["x", "y", "z"];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Separator {
    Letter(char),
    Blanks,
}

struct Layout {
    separator: Separator,
    /// Those of x, y and z, and of what else there is of a point.
    columns: Vec<usize>,
    unit_m: [f64; 3],
    /// What the columns after z hold.
    extras: Vec<Extra>,
    /// Whether nothing names the columns, and there are more than three.
    is_guessed: bool,
}

pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Cloud, FormatError> {
    let mut lines = Lines::new(reader, name);
    let mut layout: Option<Layout> = None;
    let (mut rows, mut row) = (Rows::default(), Vec::new());
    // The number of points that the counts so far promise.
    let mut promised = None;
    let mut comment = String::new();
    let mut are_decimal_commas = true;
    while let Some(line) = lines.next()? {
        if line.text.contains('\r') {
            let cause = "expected lines that end in LF or CR LF, found CR alone: convert them";
            return Err(line.error(cause));
        }
        let content = without_comment(&line.text);
        if content.is_empty() {
            if layout.is_none() && !line.text.is_empty() {
                comment = line.text.trim_start_matches(['#', '/', ' ']).to_owned();
            }
            continue;
        }
        let found = rows.points().len() as u64;
        let is_complete = promised.is_some_and(|n| n == found);
        if (layout.is_none() || is_complete)
            && let Ok(n) = content.parse::<u64>()
        {
            promised = Some(found.saturating_add(n));
            continue;
        }
        if is_complete {
            return Err(line.error(format!("expected {found} points by the count, found more")));
        }
        match &layout {
            Some(layout) => {
                are_decimal_commas = are_decimal_commas && has_decimal_commas(content);
                layout.read(&line, content, &mut row)?;
                rows.push(&row);
            }
            None => {
                let (first, is_header) = Layout::from_first_line(&line, content, &comment)?;
                rows = Rows::new(first.extras.iter().copied());
                if !is_header {
                    are_decimal_commas = has_decimal_commas(content);
                    first.read(&line, content, &mut row)?;
                    rows.push(&row);
                }
                layout = Some(first);
            }
        }
    }
    let points = rows.points();
    match promised {
        Some(n) if n > points.len() as u64 => {
            let cause = format!("the file ends after {} of {n}", points.len());
            Err(FormatError::malformed(name, "points", cause))
        }
        _ if layout.is_some_and(|layout| layout.is_guessed) && has_line_numbers(points) => {
            let cause = "expected x, y and z, found numbers of the lines in the first column: leave \
                         it out, or name the columns in a first line, such as `n,x,y,z`";
            Err(FormatError::malformed(name, "columns", cause))
        }
        _ if are_decimal_commas && points.len() >= FEWEST => {
            let cause = "expected x, y and z, found pairs of whole numbers, probably with decimal \
                         commas: write decimal points, or semicolons between the columns";
            Err(FormatError::malformed(name, "columns", cause))
        }
        _ => Ok(rows.cloud()),
    }
}

/// Fewer points could have the looks of other columns by chance.
const FEWEST: usize = 8;

/// Whether the x of `points` counts them, from 0 or 1, while y or z are not whole numbers.
fn has_line_numbers(points: &[[f64; 3]]) -> bool {
    let counts_from = |first: usize| (first..).zip(points).all(|(n, [x, ..])| *x == n as f64);
    points.len() >= FEWEST
        && (counts_from(0) || counts_from(1))
        && points.iter().any(|[_, y, z]| y.fract() != 0.0 || z.fract() != 0.0)
}

/// Whether `content` is six whole numbers between commas, of which the second of each pair have no
/// sign and equally many digits, as `1,250,-3,500,2,750`: 1.25, -3.5 and 2.75.
fn has_decimal_commas(content: &str) -> bool {
    let fields: Vec<&str> = content.split(',').map(str::trim).collect();
    let are_digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let is_pair = |pair: &[&str]| {
        are_digits(pair[0].trim_start_matches('-'))
            && are_digits(pair[1])
            && pair[1].len() == fields[1].len()
    };
    fields.len() == 6 && fields[1].len() > 1 && fields.chunks(2).all(is_pair)
}

fn without_comment(line: &str) -> &str {
    let content = line.split('#').next().unwrap_or_default().trim();
    if content.starts_with("//") { "" } else { content }
}

impl Layout {
    /// The layout by the first line, and whether that has names.
    /// If it has not, the `comment` before it may have them.
    fn from_first_line(
        line: &Line<'_>,
        content: &str,
        comment: &str,
    ) -> Result<(Self, bool), FormatError> {
        let separator = Separator::in_line(content);
        let fields: Vec<_> = separator.fields(content).collect();
        if fields.len() < AXES.len() {
            let cause = format!("expected x, y and z, found {} column(s)", fields.len());
            return Err(line.error(cause));
        }
        let n = fields.len();
        let is_numbered = fields[0].is_empty()
            && n > AXES.len()
            && (0..).zip(&fields[1..]).all(|(i, field)| field.parse() == Ok(i));
        if is_numbered {
            return Ok((Self::unnamed(separator, 1), true));
        }
        let is_header = fields.iter().all(|field| is_name(field));
        let names: Vec<_> = match is_header {
            true => fields,
            false => separator.fields(comment).collect(),
        };
        let places = AXES.map(|axis| {
            let exact = names.iter().position(|name| name.eq_ignore_ascii_case(axis));
            let usual =
                || names.iter().position(|name| axis_named(name).is_some_and(|(a, _)| a == axis));
            exact.or_else(usual)
        });
        if let [Some(x), Some(y), Some(z)] = places
            && names.len() == n
        {
            let unit_m =
                [x, y, z].map(|at| axis_named(names[at]).map_or(1.0, |(_, unit_m)| unit_m));
            let place = |of: &str| names.iter().position(|name| name.eq_ignore_ascii_case(of));
            let (more, extras): (Vec<_>, _) = columns::find(place).into_iter().unzip();
            let columns = [x, y, z].into_iter().chain(more).collect();
            let layout = Self { separator, columns, unit_m, extras, is_guessed: false };
            return Ok((layout, is_header));
        }
        if is_header {
            let missing = AXES.into_iter().zip(places).find(|(_, place)| place.is_none());
            let (axis, _) = missing.expect("invariant: three places return above");
            let found = excerpt(content);
            return Err(line.error(format!(
                "expected a column named {axis} (or pos_{axis}, {axis}_m and the like), found \
                 `{found}`"
            )));
        }
        Ok((Self { is_guessed: n > AXES.len(), ..Self::unnamed(separator, 0) }, false))
    }

    /// The layout of lines whose coordinates begin in the column `first`.
    fn unnamed(separator: Separator, first: usize) -> Self {
        let columns = (first..first + AXES.len()).collect();
        Self { separator, columns, unit_m: [1.0; 3], extras: Vec::new(), is_guessed: false }
    }

    /// Reads the numbers of a line into `row`. An intensity that is missing or not a number is NaN.
    fn read(&self, line: &Line<'_>, content: &str, row: &mut Vec<f64>) -> Result<(), FormatError> {
        row.clear();
        row.resize(self.columns.len(), f64::NAN);
        let mut missing = AXES.len();
        for (i, field) in self.separator.fields(content).enumerate() {
            let Some(at) = self.columns.iter().position(|&column| column == i) else { continue };
            if at >= AXES.len() {
                row[at] = field.parse().unwrap_or(f64::NAN);
                continue;
            }
            if self.separator != Separator::Letter(',') && field.contains(',') {
                let cause = "expected a decimal point, or commas between all columns, found";
                return Err(line.error(format!("{cause} `{}`", excerpt(field))));
            }
            row[at] = line.number(field)? * self.unit_m[at];
            missing -= 1;
        }
        if missing == 0 {
            return Ok(());
        }
        let expected = self.columns[..AXES.len()].iter().max().map_or(0, |last| last + 1);
        let found = self.separator.fields(content).count();
        Err(line.error(format!("expected {expected} columns, found {found}")))
    }
}

/// The axis of a column with a usual name, such as `pos_x`, `X (mm)` or ParaView's `Points:0`, and its
/// unit, metres.
fn axis_named(name: &str) -> Option<(&'static str, f64)> {
    /// What names say beside the axis, longer ones first.
    const PLACES: [&str; 9] =
        ["coordinate", "coord", "position", "pos", "points", "point", "location", "xyz", "p"];
    let name = name.to_ascii_lowercase();
    let (mut found, mut unit_m, mut is_place) = (None, 1.0, false);
    for word in name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()) {
        let bare = |place: &&str| word.strip_prefix(place).or(word.strip_suffix(place));
        let at = match PLACES.iter().find_map(bare).unwrap_or(word) {
            "" | "s" => {
                is_place = true;
                continue;
            }
            "m" | "meter" | "metre" | "meters" | "metres" => continue,
            "mm" | "cm" => {
                unit_m = if word == "mm" { 1e-3 } else { 1e-2 };
                continue;
            }
            "x" | "easting" | "east" => 0,
            "y" | "northing" | "north" => 1,
            "z" | "height" | "altitude" | "up" => 2,
            number @ ("0" | "1" | "2") if is_place => usize::from(number.as_bytes()[0] - b'0'),
            _ => return None,
        };
        if found.replace(AXES[at]).is_some() {
            return None;
        }
    }
    Some((found?, unit_m))
}

/// Whether `field` can be a column's name: neither a number nor an attempt at
/// one, such as `1,5`.
fn is_name(field: &str) -> bool {
    let begins_like_a_number = |letter: char| letter.is_ascii_digit() || "+-.".contains(letter);
    field.parse::<f64>().is_err() && !field.starts_with(begins_like_a_number)
}

impl Separator {
    fn in_line(content: &str) -> Self {
        // Tabs between columns leave commas to the decimals.
        let is_within = |field: &str| field.trim().contains('\t');
        let letter = match [';', ',', '\t'].into_iter().find(|&letter| content.contains(letter)) {
            Some(',') if content.split(',').any(is_within) => Some('\t'),
            letter => letter,
        };
        letter.map_or(Self::Blanks, Self::Letter)
    }

    /// The columns of a line, without the blanks and quotes around them.
    fn fields(self, content: &str) -> impl Iterator<Item = &str> {
        let separates = move |letter: char| match self {
            Self::Letter(own) => letter == own,
            Self::Blanks => letter.is_ascii_whitespace(),
        };
        let fields = content.split(separates).map(|field| field.trim().trim_matches('"'));
        // Several blanks are one separator.
        fields.filter(move |field| !field.is_empty() || self != Self::Blanks)
    }
}

/// Writes `points` separated by blanks, with the fewest digits that read back
/// as the same f64.
pub(super) fn write(writer: &mut impl Write, points: &[[f64; 3]]) -> io::Result<()> {
    points.iter().try_for_each(|[x, y, z]| writeln!(writer, "{x:?} {y:?} {z:?}"))
}

/// Writes `points` separated by commas, under a line of names.
pub(super) fn write_csv(writer: &mut impl Write, points: &[[f64; 3]]) -> io::Result<()> {
    writeln!(writer, "x,y,z")?;
    points.iter().try_for_each(|[x, y, z]| writeln!(writer, "{x:?},{y:?},{z:?}"))
}
