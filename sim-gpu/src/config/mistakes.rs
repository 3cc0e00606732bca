//! All mistakes of a TOML file at once.
//!
//! Serde stops at the first mistake. The file is therefore read again, without each value that is
//! wrong and with a stand-in for each that is missing, until nothing new is found. The only schema is
//! the types that are read.

use std::fmt;
use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer, Error};

use super::{InvalidValue, one_of};

/// The most mistakes that are looked for.
const MOST: usize = 32;

/// The stand-ins for a missing value, in the order in which they are tried. The first is a number
/// that files do not hold: a message about it is a consequence of the missing value.
const STAND_INS: [&str; 9] =
    [ODD, "1", "\"x\"", "true", "[1, 1, 1]", "[1, 1]", "[1, 1, 1, 1]", "[{}]", "{}"];
const ODD: &str = "0.71828182";

/// Everything that is wrong with a file, sorted by line.
pub(super) struct Mistakes(Vec<Mistake>);

struct Mistake {
    /// The line, from 1; `None` where the key's table is the file itself.
    line: Option<usize>,
    key: String,
    cause: String,
    /// Whether it is a consequence of another mistake, which the user is not told.
    follows: bool,
}

impl Mistakes {
    /// What `check` makes of the `text`, or everything that is wrong with it.
    pub fn find<T: DeserializeOwned, U>(
        text: &str,
        check: impl Fn(T) -> Result<U, Vec<InvalidValue>>,
    ) -> Result<U, Self> {
        let (root, errors) = DeTable::parse_recoverable(text);
        let mut reader = Reader { text, root, stand_ins: Vec::new(), found: Vec::new() };
        for error in &errors {
            let line = error.span().map(|span| reader.line(&span));
            let (key, cause) = (String::new(), error.message().to_owned());
            reader.found.push(Mistake { line, key, cause, follows: false });
        }
        while errors.is_empty() && reader.found.len() < MOST {
            let is_new = match T::deserialize(Deserializer::from(reader.root.clone())) {
                Err(error) => reader.mend(&error),
                Ok(value) => match check(value) {
                    Ok(made) if reader.found.is_empty() => return Ok(made),
                    Ok(_) => false,
                    Err(all) => reader.refuse(all),
                },
            };
            if !is_new {
                break;
            }
        }
        let mut found = reader.found;
        found.retain(|mistake| !mistake.follows);
        found.sort_by_key(|mistake| mistake.line);
        Err(Self(found))
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [only] = &self.0[..] {
            return only.fmt(f);
        }
        write!(f, "{} mistakes:", self.0.len())?;
        self.0.iter().try_for_each(|mistake| write!(f, "\n  {mistake}"))
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        f.write_str(&self.cause)
    }
}

struct Reader<'a> {
    text: &'a str,
    root: Spanned<DeTable<'a>>,
    /// The keys that were missing, and the stand-in of each, as an index.
    stand_ins: Vec<(String, usize)>,
    found: Vec<Mistake>,
}

impl Reader<'_> {
    /// Notes what serde found, and mends it. Returns whether to read again.
    fn mend(&mut self, error: &Error) -> bool {
        let span = error.span().unwrap_or_default();
        let at = path_in_table(self.root.get_ref(), &span).unwrap_or_default();
        let message = error.message();
        if let Some(field) = message.strip_prefix("missing field `") {
            let field = field.trim_end_matches('`');
            let key = if at.is_empty() { field.to_owned() } else { format!("{at}.{field}") };
            self.note(&key, "expected a value, found none".to_owned());
            self.stand_ins.push((key.clone(), 0));
            return self.insert(&key, stand_in(0));
        }
        if let Some((key, nth)) = self.stand_ins.iter_mut().rfind(|(key, _)| is_within(&at, key)) {
            *nth += 1;
            let (key, nth) = (key.clone(), *nth);
            let is_variant = message.starts_with("unknown variant") && nth < STAND_INS.len();
            let variant = message.split('`').nth(3).filter(|_| is_variant);
            let named = variant.map(|name| DeValue::String(name.to_owned().into()));
            return self.insert(&key, named.or_else(|| stand_in(nth)));
        }
        let last = at.rsplit('.').next().unwrap_or_default();
        let invalid = match message.split_once(": ") {
            // From a check within serde, such as `effects.noise.sigma_m: expected ...`.
            Some((key, cause)) if !last.is_empty() && is_within(key, last) => {
                InvalidValue::new(format!("{at}{}", &key[last.len()..]), cause)
            }
            _ => InvalidValue::new(at, self.cause(message, span)),
        };
        self.refuse(vec![invalid])
    }

    /// Notes unfit values, and removes those that are new. Returns whether to read again.
    fn refuse(&mut self, mut all: Vec<InvalidValue>) -> bool {
        all.retain(|invalid| self.note(&invalid.key, invalid.cause.clone()));
        for InvalidValue { key, .. } in &all {
            let (above, last) = key.rsplit_once('.').unwrap_or(("", key));
            // A list is removed whole, so that the numbers of its items stay; one of tables is kept.
            let name = last.split('[').next().unwrap_or_default();
            let is_tables = |value: &Spanned<DeValue>| {
                value.get_ref().get(0).is_some_and(|item| item.get_ref().is_table())
            };
            if let Some(table) = table_mut(self.root.get_mut(), above)
                && !table.get(name).is_some_and(is_tables)
            {
                table.remove(name);
            }
        }
        !all.is_empty()
    }

    /// Notes a mistake, and returns whether it is new: its key was not known to be wrong.
    fn note(&mut self, key: &str, cause: String) -> bool {
        if self.found.iter().any(|known| is_within(key, &known.key)) {
            return false;
        }
        let is_about = |key: &str| {
            let part = |c: char| c.is_alphanumeric() || "_.[]".contains(c);
            cause.split(|c| !part(c)).any(|word| word == key)
        };
        let table = |key: &str| key.rsplit_once('.').map_or(String::new(), |(it, _)| it.to_owned());
        let follows = |known: &Mistake| {
            let beside = table(&known.key);
            let meant = known.cause.split("did you mean \"").nth(1);
            let meant = meant.and_then(|rest| rest.split('"').next()).filter(|_| {
                // About the table that lacks the key that was meant, or about that key.
                beside == key || beside == table(key)
            });
            let is_meant = |word| is_about(word) || key.rsplit('.').next() == Some(word);
            !known.key.is_empty() && is_about(&known.key) || meant.is_some_and(is_meant)
        };
        let follows = cause.contains(ODD) || self.found.iter().any(follows);
        let line = nearest(self.root.get_ref(), key).map(|span| self.line(&span));
        self.found.push(Mistake { line, key: key.to_owned(), cause, follows });
        true
    }

    fn insert(&mut self, key: &str, value: Option<DeValue<'static>>) -> bool {
        // Behind the text, where nothing else is.
        let place = self.text.len() + self.found.len() + self.stand_ins.len();
        let (above, name) = key.rsplit_once('.').unwrap_or(("", key));
        let table = table_mut(self.root.get_mut(), above);
        let (Some(value), Some(table)) = (value, table) else { return false };
        let span = place..place + 1;
        table.insert(Spanned::new(span.clone(), name.to_owned().into()), placed(value, &span));
        true
    }

    /// Serde's `message` in words that those who write TOML know.
    fn cause(&self, message: &str, span: Range<usize>) -> String {
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
        let found = self.text.get(span).unwrap_or_default();
        let found = found.lines().next().unwrap_or("nothing");
        let expected = match message.split_once(", expected ") {
            Some((_, expected)) => format!("expected {}", in_toml(expected)),
            None => message.to_owned(),
        };
        format!("{expected}, found {found}")
    }

    /// The line of a place in the text, from 1.
    fn line(&self, span: &Range<usize>) -> usize {
        1 + self.text[..span.start.min(self.text.len())].matches('\n').count()
    }
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
        "a map" => return "a table".to_owned(),
        other if other.starts_with("struct ") => return "a table".to_owned(),
        other => return other.replace("an array", "a list"),
    };
    let least = u8::from(expected.starts_with("a nonzero"));
    format!("a whole number within {least}..={most}")
}

fn stand_in(nth: usize) -> Option<DeValue<'static>> {
    let value = STAND_INS.get(nth).map(|text| DeValue::parse(text));
    value.map(|value| value.expect("invariant: stand-ins are TOML").into_inner())
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

/// The path of what is at `span`, such as `rotating.beam[3]`: the innermost of several.
fn path_in_table(table: &DeTable, span: &Range<usize>) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let below = path_below(value, span);
        let below = below.or_else(|| (key.span() == *span).then(String::new));
        below.map(|below| format!("{}{below}", key.get_ref()))
    })
}

fn path_below(value: &Spanned<DeValue>, span: &Range<usize>) -> Option<String> {
    let below = match value.get_ref() {
        DeValue::Table(table) => path_in_table(table, span).map(|path| format!(".{path}")),
        DeValue::Array(items) => items
            .iter()
            .enumerate()
            .find_map(|(i, item)| path_below(item, span).map(|path| format!("[{i}]{path}"))),
        _ => None,
    };
    below.or_else(|| (value.span() == *span).then(String::new))
}

/// The steps of a path: `rotating`, `beam`, `3`.
fn steps(path: &str) -> impl Iterator<Item = &str> {
    path.split(['.', '[']).map(|step| step.trim_end_matches(']'))
}

/// The place of the value at `path`, or of the nearest one above it.
fn nearest(root: &DeTable, path: &str) -> Option<Range<usize>> {
    let mut steps = steps(path);
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

fn table_mut<'t, 'a>(root: &'t mut DeTable<'a>, path: &str) -> Option<&'t mut DeTable<'a>> {
    if path.is_empty() {
        return Some(root);
    }
    let mut steps = steps(path);
    let mut value = root.get_mut(steps.next()?)?.get_mut();
    for step in steps {
        value = match value {
            DeValue::Array(items) => items.get_mut(step.parse::<usize>().ok()?)?.get_mut(),
            DeValue::Table(table) => table.get_mut(step)?.get_mut(),
            _ => return None,
        };
    }
    match value {
        DeValue::Table(table) => Some(table),
        _ => None,
    }
}
