//! All mistakes of a TOML file at once.
//!
//! Serde stops at the first mistake. Where it finds one, each table and item is therefore read apart,
//! without the rest of the file. Only if all are of the right types are their values checked. The only
//! schema is the types that are read.

use std::fmt;
use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue, Deserializer, Error};

use crate::InvalidValue;

/// The largest number of mistakes in a message.
const MOST: usize = 20;
/// The largest number of errors of syntax in a message.
const MOST_OF_SYNTAX: usize = 3;

/// The largest number of characters of a value in a message.
const MOST_CHARS: usize = 60;

/// The values that stand in for a missing one, in the order in which they are tried, so that serde
/// finds the next missing one.
const STAND_INS: [&str; 8] =
    ["1", "\"x\"", "true", "[1, 1, 1]", "[1, 1]", "[1, 1, 1, 1]", "[]", "{}"];

/// Everything that is wrong with a file, sorted by line.
#[derive(Debug)]
pub struct Mistakes {
    all: Vec<Mistake>,
    /// How many of them a message has.
    most: usize,
}

#[derive(Debug)]
struct Mistake {
    /// The line, from 1; `None` where the key's table is the file itself.
    line: Option<usize>,
    invalid: InvalidValue,
}

impl Mistakes {
    /// What `check` makes of the `text`, or everything that is wrong with it.
    ///
    /// # Errors
    /// All unknown keys, missing keys and values of other types; in a file without these, all that `check`
    /// refuses.
    pub fn find<T: DeserializeOwned, U>(
        text: &str,
        check: impl Fn(T) -> Result<U, Vec<InvalidValue>>,
    ) -> Result<U, Self> {
        let line_starts: Vec<usize> = text.match_indices('\n').map(|(at, _)| at + 1).collect();
        let line = |at: usize| 1 + line_starts.partition_point(|&start| start <= at);
        let (root, errors) = DeTable::parse_recoverable(text);
        if !errors.is_empty() {
            let mistake = |error: &Error| Mistake {
                line: error.span().map(|span| line(span.start)),
                invalid: InvalidValue::new("", error.message()),
            };
            // Of a file that is no TOML, each line is an error.
            let Self { all, .. } = Self::sorted(errors.iter().map(mistake));
            return Err(Self { all, most: MOST_OF_SYNTAX });
        }
        let read = |root| T::deserialize(Deserializer::from(root));
        let found = match read(root.clone()) {
            Ok(value) => match check(value) {
                Ok(made) => return Ok(made),
                Err(all) => all,
            },
            Err(_) => {
                let mut nodes = Vec::new();
                let root = Spanned::new(root.span(), DeValue::Table(root.get_ref().clone()));
                let root = numbered(root, String::new(), &mut nodes);
                let read = |root| read(root).err();
                let mut reader =
                    Reader { text, nodes, read: &read, above: Vec::new(), found: Vec::new() };
                reader.probe(&root);
                reader.found
            }
        };
        let mistake = |invalid: InvalidValue| Mistake {
            line: nearest(root.get_ref(), &invalid.key).map(|span| line(span.start)),
            invalid,
        };
        Err(Self::sorted(found.into_iter().map(mistake)))
    }

    fn sorted(all: impl Iterator<Item = Mistake>) -> Self {
        let mut all: Vec<Mistake> = all.collect();
        all.sort_by_key(|mistake| mistake.line);
        Self { all, most: MOST }
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [only] = &self.all[..] {
            return only.fmt(f);
        }
        write!(f, "{} mistakes:", self.all.len())?;
        for mistake in self.all.iter().take(self.most) {
            write!(f, "\n  {}", mistake.to_string().replace('\n', "\n  "))?;
        }
        match self.all.len().saturating_sub(self.most) {
            0 => Ok(()),
            more => write!(f, "\n  and {more} more"),
        }
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        match self.invalid.key.is_empty() {
            true => f.write_str(&self.invalid.cause),
            false => self.invalid.fmt(f),
        }
    }
}

struct Reader<'a> {
    text: &'a str,
    /// The path and the place in the text of each value. The span of value i begins at i, as tables
    /// may share a heading.
    nodes: Vec<(String, Range<usize>)>,
    read: &'a dyn Fn(Spanned<DeTable<'a>>) -> Option<Error>,
    /// The tables, each with the key, and the lists above the value that is read.
    above: Vec<(Range<usize>, Option<Spanned<DeString<'a>>>)>,
    found: Vec<InvalidValue>,
}

impl<'a> Reader<'a> {
    /// Notes what is wrong within `value`, and returns whether nothing is.
    fn probe(&mut self, value: &Spanned<DeValue<'a>>) -> bool {
        let id = value.span().start;
        let Some(invalid) =
            self.read_apart(value.clone()).and_then(|error| self.within(id, &error))
        else {
            return true;
        };
        let known = self.found.len();
        match value.get_ref() {
            DeValue::Array(items) => {
                for item in items {
                    self.probe_below(value.span(), None, item);
                }
            }
            DeValue::Table(table) => {
                let mut sound = table.clone();
                for (key, below) in table {
                    if !self.probe_below(value.span(), Some(key.clone()), below) {
                        sound.remove(key.get_ref().as_ref());
                    }
                }
                self.note_missing(value.span(), table, sound, known);
            }
            _ => {}
        }
        if self.found.len() == known {
            self.found.push(invalid);
        }
        false
    }

    fn probe_below(
        &mut self,
        span: Range<usize>,
        key: Option<Spanned<DeString<'a>>>,
        below: &Spanned<DeValue<'a>>,
    ) -> bool {
        self.above.push((span, key));
        let is_sound = self.probe(below);
        self.above.pop();
        is_sound
    }

    /// Reads a file that holds only this `value`.
    fn read_apart(&self, mut value: Spanned<DeValue<'a>>) -> Option<Error> {
        for (span, key) in self.above.iter().rev() {
            let outer = match key {
                Some(key) => {
                    let mut table = DeTable::new();
                    table.insert(key.clone(), value);
                    DeValue::Table(table)
                }
                None => DeValue::Array(std::iter::once(value).collect()),
            };
            value = Spanned::new(span.clone(), outer);
        }
        let span = value.span();
        let DeValue::Table(root) = value.into_inner() else { return None };
        (self.read)(Spanned::new(span, root))
    }

    /// What is wrong, if it is within value `id`, which was read apart.
    fn within(&self, id: usize, error: &Error) -> Option<InvalidValue> {
        let of = &self.nodes[id].0;
        let (path, place) = self.nodes.get(error.span().map_or(0, |span| span.start))?;
        let is_inside = of.is_empty() || is_within(path, of);
        // From a check within serde, such as `effects.noise.sigma_m: expected ...`.
        let last = path.rsplit('.').next().unwrap_or_default();
        if !last.is_empty()
            && let Some((key, cause)) = error.message().split_once(": ")
            && is_within(key, last)
        {
            if is_inside {
                return Some(InvalidValue::new(format!("{path}{}", &key[last.len()..]), cause));
            }
            // A list that holds only one item numbers it 0.
            let first = |path: &str| {
                let zero = |(i, step): (usize, &str)| match step.split_once(']') {
                    Some((_, rest)) if i > 0 => format!("[0]{rest}"),
                    _ => step.to_owned(),
                };
                path.split('[').enumerate().map(zero).collect::<String>()
            };
            let (key, of_first) = (format!("{}{}", first(path), &key[last.len()..]), first(of));
            return is_within(&key, &of_first)
                .then(|| InvalidValue::new(format!("{of}{}", &key[of_first.len()..]), cause));
        }
        is_inside.then(|| match missing(error) {
            Some(field) => missing_in(path, field),
            None => InvalidValue::new(path, self.cause(error.message(), place)),
        })
    }

    /// Notes the keys that a `table` lacks, of which the `sound` part can be read.
    fn note_missing(
        &mut self,
        span: Range<usize>,
        table: &DeTable<'a>,
        mut sound: DeTable<'a>,
        known: usize,
    ) {
        let behind = self.nodes.len();
        let path = self.nodes[span.start].0.clone();
        let mut last = (String::new(), 0);
        while let Some(error) =
            self.read_apart(Spanned::new(span.clone(), DeValue::Table(sound.clone())))
        {
            let at = error.span().map_or(0, |span| span.start);
            let mut named = None;
            match missing(&error) {
                Some(field) if at == span.start && !sound.contains_key(field) => {
                    let meant = format!("did you mean \"{field}\"?");
                    let is_meant = self.found[known..].iter().any(|it| it.cause.contains(&meant));
                    if !is_meant && !table.contains_key(field) {
                        self.found.push(missing_in(&path, field));
                    }
                    last = (field.to_owned(), 0);
                }
                _ if at == behind => {
                    last.1 += 1;
                    let is_variant = error.message().starts_with("unknown variant");
                    named = error.message().split('`').nth(3).filter(|_| is_variant);
                }
                _ => break,
            }
            let Some(text) = STAND_INS.get(last.1) else { break };
            let value = match named {
                Some(name) => DeValue::String(name.to_owned().into()),
                None => DeValue::parse(text).expect("invariant: stand-ins are TOML").into_inner(),
            };
            let span = behind..behind + 1;
            sound.remove(last.0.as_str());
            sound.insert(Spanned::new(span.clone(), last.0.clone().into()), placed(value, &span));
        }
    }

    /// Serde's `message` in words that those who write TOML know.
    fn cause(&self, message: &str, place: &Range<usize>) -> String {
        let mut words = message.split('`').skip(1).step_by(2);
        if message.starts_with("unknown field") || message.starts_with("unknown variant") {
            let word = words.next().unwrap_or_default();
            return one_of(word, &words.collect::<Vec<_>>());
        }
        if let Some((word, known)) = message
            .strip_prefix("unexpected keys in table: ")
            .and_then(|words| words.split_once(", available keys: "))
        {
            return one_of(word, &known.split(", ").collect::<Vec<_>>());
        }
        if message.contains(", found ") {
            return message.to_owned();
        }
        let found = self.text.get(place.clone()).unwrap_or_default();
        let found: Vec<&str> = found.split_whitespace().collect();
        let mut found = found.join(" ");
        if let Some((at, _)) = found.char_indices().nth(MOST_CHARS) {
            found.replace_range(at.., "...");
        }
        let expected = match message.split_once(", expected ") {
            Some((_, expected)) => format!("expected {}", in_toml(expected)),
            None => message.to_owned(),
        };
        format!("{expected}, found {found}")
    }
}

/// `expected one of range, ring, found "rnig"; did you mean "ring"?`
#[must_use]
pub fn one_of(word: &str, known: &[&str]) -> String {
    let meant = did_you_mean(word, known.iter().copied());
    format!("expected one of {}, found \"{word}\"{meant}", known.join(", "))
}

/// `; did you mean "noise"?` if one of `known` is close to `word`, and nothing otherwise.
#[must_use]
pub fn did_you_mean<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> String {
    let word = &*word.to_lowercase();
    // As clap and git: at most a third of the word is wrong, or its unit is missing.
    let distance = |known: &&str| match known.strip_prefix(word) {
        Some(unit) if unit.starts_with('_') => 0,
        _ => strsim::damerau_levenshtein(word, known),
    };
    let closest = known.min_by_key(distance);
    let closest = closest.filter(|known| 3 * distance(known) <= word.chars().count());
    closest.map(|known| format!("; did you mean \"{known}\"?")).unwrap_or_default()
}

/// Serde's name of a type, in TOML's terms.
fn in_toml(expected: &str) -> String {
    let most = match expected {
        "u16" => u16::MAX.into(),
        "u32" | "a nonzero u32" => u32::MAX.into(),
        "u64" | "usize" | "a nonzero u64" => u64::MAX,
        "f32" | "f64" => return "a number".to_owned(),
        "a boolean" => return "true or false".to_owned(),
        "a sequence" => return "a list".to_owned(),
        "path string" => return "a file's path".to_owned(),
        "a map" => return "a table".to_owned(),
        other if other.starts_with("struct ") => return "a table".to_owned(),
        other => return other.replace("an array", "a list"),
    };
    let least = u8::from(expected.starts_with("a nonzero"));
    format!("a whole number within {least}..={most}")
}

/// The field that `error` says is missing.
fn missing(error: &Error) -> Option<&str> {
    Some(error.message().strip_prefix("missing field `")?.trim_end_matches('`'))
}

fn missing_in(table: &str, field: &str) -> InvalidValue {
    let key = if table.is_empty() { field.to_owned() } else { format!("{table}.{field}") };
    InvalidValue::new(key, "expected a value, found none")
}

/// The `value`, with its number among `nodes` as its span and its key's.
fn numbered<'a>(
    value: Spanned<DeValue<'a>>,
    path: String,
    nodes: &mut Vec<(String, Range<usize>)>,
) -> Spanned<DeValue<'a>> {
    let span = nodes.len()..nodes.len() + 1;
    nodes.push((path.clone(), value.span()));
    let value = match value.into_inner() {
        DeValue::Array(items) => {
            let items = items.into_iter().enumerate();
            DeValue::Array(
                items.map(|(i, item)| numbered(item, format!("{path}[{i}]"), nodes)).collect(),
            )
        }
        DeValue::Table(table) => {
            let mut all = DeTable::new();
            for (key, below) in table {
                let key = key.into_inner();
                let dot = if path.is_empty() { "" } else { "." };
                let below = numbered(below, format!("{path}{dot}{key}"), nodes);
                all.insert(Spanned::new(below.span(), key), below);
            }
            DeValue::Table(all)
        }
        other => other,
    };
    Spanned::new(span, value)
}

/// The `value` and its items, as if they were at `span`.
fn placed<'a>(value: DeValue<'a>, span: &Range<usize>) -> Spanned<DeValue<'a>> {
    let value = match value {
        DeValue::Array(items) => {
            DeValue::Array(items.into_iter().map(|item| placed(item.into_inner(), span)).collect())
        }
        other => other,
    };
    Spanned::new(span.clone(), value)
}

/// Whether `key` is `of` or below it.
fn is_within(key: &str, of: &str) -> bool {
    key.strip_prefix(of).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// The place of the value at `path`, or of the nearest one above it.
fn nearest(root: &DeTable, path: &str) -> Option<Range<usize>> {
    let mut steps = path.split(['.', '[']).map(|step| step.trim_end_matches(']'));
    let mut value = root.get(steps.next()?)?;
    for step in steps {
        let below = match step.parse::<usize>() {
            Ok(index) => value.get_ref().get(index),
            Err(_) => value.get_ref().get(step),
        };
        let Some(below) = below else { break };
        value = below;
    }
    Some(value.span())
}
