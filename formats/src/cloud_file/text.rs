//! Clouds as text, with a line for each point.
//!
//! Semicolons, commas, tabs or blanks separate columns: the first of these that the
//! first line has. A first line of names states the columns of x, y and z; otherwise
//! they are the first three. Text after a `#`, and a line that begins with `//`, is a comment. A
//! line with nothing but a count is that of the points after it, as in Leica's `.pts`.

use std::io::{self, BufRead, Write};
use std::path::Path;

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
    columns: [usize; 3],
}

pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Vec<[f64; 3]>, FormatError> {
    let mut lines = Lines::new(reader, name);
    let mut layout: Option<Layout> = None;
    let mut points = Vec::new();
    // The number of points that the counts so far promise.
    let mut promised = None;
    while let Some(line) = lines.next()? {
        let content = without_comment(&line.text);
        if content.is_empty() {
            continue;
        }
        let found = points.len() as u64;
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
            Some(layout) => points.push(layout.point(&line, content)?),
            None => {
                let (first, is_header) = Layout::from_first_line(&line, content)?;
                if !is_header {
                    points.push(first.point(&line, content)?);
                }
                layout = Some(first);
            }
        }
    }
    match promised {
        Some(n) if n > points.len() as u64 => {
            let cause = format!("the file ends after {} of {n}", points.len());
            Err(FormatError::malformed(name, "points", cause))
        }
        _ => Ok(points),
    }
}

fn without_comment(line: &str) -> &str {
    let content = line.split('#').next().unwrap_or_default().trim();
    if content.starts_with("//") { "" } else { content }
}

impl Layout {
    /// The layout by the first line, and whether that has names.
    fn from_first_line(line: &Line<'_>, content: &str) -> Result<(Self, bool), FormatError> {
        let separator = Separator::in_line(content);
        let fields: Vec<_> = separator.fields(content).collect();
        if fields.len() < AXES.len() {
            let cause = format!("expected x, y and z, found {} column(s)", fields.len());
            return Err(line.error(cause));
        }
        let place = |axis: &str| fields.iter().position(|name| name.eq_ignore_ascii_case(axis));
        let places = AXES.map(place);
        if let [Some(x), Some(y), Some(z)] = places {
            return Ok((Self { separator, columns: [x, y, z] }, true));
        }
        let is_header = fields.iter().all(|field| is_name(field));
        let mut missing = AXES.into_iter().zip(places).filter(|(_, place)| place.is_none());
        let is_named = places.iter().any(Option::is_some);
        if is_header
            && is_named
            && let Some((axis, _)) = missing.next()
        {
            return Err(line.error(format!("expected a column named {axis} beside those named")));
        }
        Ok((Self { separator, columns: [0, 1, 2] }, is_header))
    }

    fn point(&self, line: &Line<'_>, content: &str) -> Result<[f64; 3], FormatError> {
        let mut point = [0.0; 3];
        let mut missing = AXES.len();
        for (i, field) in self.separator.fields(content).enumerate() {
            if let Some(axis) = self.columns.iter().position(|&column| column == i) {
                point[axis] = line.number(field)?;
                missing -= 1;
                if missing == 0 {
                    return Ok(point);
                }
            }
        }
        let expected = self.columns.iter().max().map_or(0, |last| last + 1);
        let found = self.separator.fields(content).count();
        Err(line.error(format!("expected {expected} columns, found {found}")))
    }
}

/// Whether `field` can be a column's name: neither a number nor an attempt at
/// one, such as `1,5`.
fn is_name(field: &str) -> bool {
    let begins_like_a_number = |letter: char| letter.is_ascii_digit() || "+-.".contains(letter);
    field.parse::<f64>().is_err() && !field.starts_with(begins_like_a_number)
}

impl Separator {
    fn in_line(content: &str) -> Self {
        let letter = [';', ',', '\t'].into_iter().find(|&letter| content.contains(letter));
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
