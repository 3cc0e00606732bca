//! The tokens of Rust source that is not test code.

/// A token and the number of its line, from 1.
#[derive(Clone, Copy)]
pub struct Token<'a> {
    pub text: &'a str,
    pub line: usize,
}

/// The tokens of `source` without comments, without the content of strings, and without items
/// under `#[cfg(test)]`. `::` is one token; any other punctuation is one character.
pub fn of(source: &str) -> Vec<Token<'_>> {
    without_tests(&split(source))
}

fn split(source: &str) -> Vec<Token<'_>> {
    let (mut tokens, mut at, mut line) = (Vec::new(), 0, 1);
    while let Some(first) = source[at..].chars().next() {
        let rest = &source[at..];
        let (length, is_token) = match first {
            _ if first.is_whitespace() => (first.len_utf8(), false),
            '/' if rest.starts_with("//") => (rest.find('\n').unwrap_or(rest.len()), false),
            '/' if rest.starts_with("/*") => (block_comment(rest), false),
            '\'' => quote(rest),
            '"' => (string(rest), true),
            _ if is_word(first) => match raw_string(rest) {
                Some(length) => (length, true),
                None => (rest.find(|c| !is_word(c)).unwrap_or(rest.len()), true),
            },
            ':' if rest.starts_with("::") => (2, true),
            _ => (first.len_utf8(), true),
        };
        let text = &rest[..length];
        if is_token {
            tokens.push(Token { text, line });
        }
        line += text.matches('\n').count();
        at += length;
    }
    tokens
}

/// Whether `c` can be part of an identifier, a keyword or a number.
pub fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn block_comment(rest: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        let step = &rest.as_bytes()[at..];
        match step {
            [b'/', b'*', ..] => (depth, at) = (depth + 1, at + 2),
            [b'*', b'/', ..] => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            return at;
        }
    }
    rest.len()
}

/// The length of a character or of a lifetime's quote, and whether it is a token.
fn quote(rest: &str) -> (usize, bool) {
    let mut chars = rest.char_indices().skip(1);
    match (chars.next(), chars.next()) {
        (Some((_, '\\')), Some((escaped, _))) => {
            let end = rest[escaped + 1..].find('\'').map_or(rest.len(), |n| escaped + n + 2);
            (end, false)
        }
        (Some(_), Some((end, '\''))) => (end + 1, false),
        _ => (1, false),
    }
}

fn string(rest: &str) -> usize {
    let mut is_escaped = false;
    for (at, c) in rest.char_indices().skip(1) {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    rest.len()
}

/// The length of a string with a prefix, such as `br#"..."#`; `None` if `rest` begins otherwise.
fn raw_string(rest: &str) -> Option<usize> {
    let prefix = ["br", "cr", "r", "b", "c"].into_iter().find(|prefix| {
        let hashes = rest.strip_prefix(prefix).map(|rest| rest.trim_start_matches('#'));
        hashes.is_some_and(|rest| rest.starts_with('"'))
    })?;
    let quoted = &rest[prefix.len()..];
    if !prefix.ends_with('r') {
        return quoted.starts_with('"').then(|| prefix.len() + string(quoted));
    }
    let hashes = quoted.len() - quoted.trim_start_matches('#').len();
    let end = format!("\"{}", &quoted[..hashes]);
    let content = &quoted[hashes + 1..];
    let length = content.find(&end).map_or(content.len(), |n| n + end.len());
    Some(prefix.len() + hashes + 1 + length)
}

fn without_tests<'a>(tokens: &[Token<'a>]) -> Vec<Token<'a>> {
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        let texts = tokens[at..].iter().take(6).map(|token| token.text);
        let opening: Vec<&str> = texts.collect();
        let is_test = match opening[..] {
            ["#", "[", "cfg", "(", "test", ")"] => true,
            ["#", "[", "cfg", "(", "all", "("] => {
                tokens.get(at + 6).is_some_and(|token| token.text == "test")
            }
            ["#", "[", "test", "]", ..] => true,
            _ => false,
        };
        if is_test {
            at += item_length(&tokens[at..]);
        } else {
            kept.push(tokens[at]);
            at += 1;
        }
    }
    kept
}

/// The number of tokens of the item, statement or field that `tokens` begins with.
fn item_length(tokens: &[Token<'_>]) -> usize {
    let (mut depth, mut is_attribute) = (0_u32, false);
    for (at, token) in tokens.iter().enumerate() {
        match token.text {
            "#" if depth == 0 => is_attribute = true,
            "(" | "[" | "{" => depth += 1,
            // The end of what the item is in.
            ")" | "]" | "}" if depth == 0 => return at,
            ")" => depth -= 1,
            "]" => {
                depth -= 1;
                is_attribute &= depth > 0;
            }
            "}" => {
                depth -= 1;
                if depth == 0 && !is_attribute {
                    return at + 1;
                }
            }
            ";" if depth == 0 => return at + 1,
            _ => {}
        }
    }
    tokens.len()
}

/// The number of tokens from an opening brace to the brace that closes it.
pub fn block_length(tokens: &[Token<'_>]) -> usize {
    let mut depth = 0;
    let end = tokens.iter().position(|token| {
        depth += depth_change(token);
        depth == 0
    });
    end.map_or(tokens.len(), |end| end + 1)
}

/// Splits `tokens` at the commas outside braces.
pub fn split_at_commas<'t, 's>(tokens: &'t [Token<'s>]) -> impl Iterator<Item = &'t [Token<'s>]> {
    let mut depth = 0;
    let parts = tokens.split(move |token| {
        depth += depth_change(token);
        depth == 0 && token.text == ","
    });
    parts.filter(|part| !part.is_empty())
}

fn depth_change(token: &Token<'_>) -> i32 {
    i32::from(token.text == "{") - i32::from(token.text == "}")
}
