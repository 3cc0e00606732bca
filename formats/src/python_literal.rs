//! Parses the Python literals of NumPy headers.

/// The keys of a Python dictionary, with the text of their values.
pub(crate) fn dictionary(text: &str) -> Option<Vec<(&str, &str)>> {
    let mut rest = text.trim().strip_prefix('{')?.strip_suffix('}')?.trim();
    let mut entries = Vec::new();
    while !rest.is_empty() {
        let (key, after) = string(rest)?;
        let after = after.trim_start().strip_prefix(':')?;
        let end = end_of_value(after)?;
        entries.push((key, after[..end].trim()));
        rest = after[end..].strip_prefix(',').unwrap_or_default().trim_start();
    }
    Some(entries)
}

/// The text between the quotes at the start of `text`, and the rest.
pub(crate) fn string(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|quote| matches!(quote, '\'' | '"'))?;
    text[1..].split_once(quote)
}

/// The position of the comma after a value, outside of brackets and quotes, or the end of the
/// text. Brackets and quotes must pair.
fn end_of_value(text: &str) -> Option<usize> {
    let mut depth = 0usize;
    let mut quote = None;
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            _ if quote == Some(byte) => quote = None,
            _ if quote.is_some() => {}
            b'\'' | b'"' => quote = Some(byte),
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.checked_sub(1)?,
            b',' if depth == 0 => return Some(at),
            _ => {}
        }
    }
    (depth == 0 && quote.is_none()).then_some(text.len())
}

/// The values in a list or tuple.
fn items(text: &str, open: char, close: char) -> Option<Vec<&str>> {
    let mut rest = text.trim().strip_prefix(open)?.strip_suffix(close)?.trim();
    let mut items = Vec::new();
    while !rest.is_empty() {
        let end = end_of_value(rest)?;
        items.push(rest[..end].trim());
        rest = rest[end..].strip_prefix(',').unwrap_or_default().trim_start();
    }
    Some(items)
}

/// The fields of a NumPy record: the name, the type, and the number of values.
pub(crate) fn record(text: &str) -> Option<Vec<(&str, &str, usize)>> {
    let field = |field| {
        let parts = items(field, '(', ')')?;
        let [name, kind, shape @ ..] = &parts[..] else { return None };
        // A title comes before its name: ('title', 'name').
        let name = items(name, '(', ')').map_or(Some(*name), |pair| pair.get(1).copied())?;
        let sizes = shape.first().map_or(Some(Vec::new()), |shape| tuple(shape))?;
        let count = sizes.iter().try_fold(1usize, |product, &size| product.checked_mul(size))?;
        Some((string(name)?.0, string(kind)?.0, count))
    };
    items(text, '[', ']')?.into_iter().map(field).collect()
}

/// A tuple of whole numbers; Python 2 wrote an `L` behind long ones.
pub(crate) fn tuple(text: &str) -> Option<Vec<usize>> {
    let numbers = text.strip_prefix('(')?.strip_suffix(')')?.trim();
    if numbers.is_empty() {
        return Some(Vec::new());
    }
    let numbers = numbers.strip_suffix(',').unwrap_or(numbers);
    let number = |word: &str| word.trim().trim_end_matches('L').parse().ok();
    numbers.split(',').map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn values_end_at_their_own_comma() {
        let entries = dictionary("{'a': [(1, 'b,]'), {}], \"c\" : 'd', }").unwrap();
        assert_eq!(entries, [("a", "[(1, 'b,]'), {}]"), ("c", "'d'")]);
        assert_eq!(dictionary(" {} "), Some(vec![]));
        for text in ["", "{", "{a: 1}", "{'a' 1}", "{'a': )}", "{'a': (}", "{'a': '}"] {
            assert_eq!(dictionary(text), None, "{text}");
        }
    }

    #[test]
    fn a_record_lists_its_fields() {
        let text = "[('x', '<f4'), (('height', 'z'), '>f8', (2, 3)), ('', '|V3')]";
        assert_eq!(record(text), Some(vec![("x", "<f4", 1), ("z", ">f8", 6), ("", "|V3", 1)]));
        for text in ["('x', '<f4')", "[('x')]", "[('x', [('y', '<f4')])]", "[('x', '<f4', 3)]"] {
            assert_eq!(record(text), None, "{text}");
        }
    }

    #[test]
    fn a_tuple_of_one_ends_in_a_comma() {
        assert_eq!(tuple("()"), Some(vec![]));
        assert_eq!(tuple("(7,)"), Some(vec![7]));
        assert_eq!(tuple("( 3L, 4 )"), Some(vec![3, 4]));
        assert_eq!(
            [tuple("(,)"), tuple("(1,,)"), tuple("(-1,)"), tuple("7")],
            [None, None, None, None]
        );
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "[{}\\[\\]()'\",: a-zé0-9]{0,60}") {
            for text in [format!("{{{text}}}"), text] {
                let _ = (dictionary(&text), string(&text), tuple(&text), record(&text));
            }
        }
    }
}
