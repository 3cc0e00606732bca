use serde::Serialize;
use serde_json::Value;

/// Characters of a value in a message. Longer values, such as tables of beams, are cut.
const LONGEST: usize = 60;

/// The first setting in which `first` and `second` differ, such as
/// `sets[0].sensor.range.max_m: 100 against 200`, or `None` if they are equal.
#[must_use]
pub fn difference(first: &impl Serialize, second: &impl Serialize) -> Option<String> {
    let value = |error: serde_json::Error| Value::String(error.to_string());
    let first = serde_json::to_value(first).unwrap_or_else(value);
    let second = serde_json::to_value(second).unwrap_or_else(value);
    between("", &first, &second)
}

fn between(path: &str, first: &Value, second: &Value) -> Option<String> {
    if first == second {
        return None;
    }
    match (first, second) {
        (Value::Object(p), Value::Object(q)) => {
            let dot = if path.is_empty() { "" } else { "." };
            let value = |of: &serde_json::Map<String, Value>, key: &String| {
                of.get(key).cloned().unwrap_or(Value::Null)
            };
            p.keys().chain(q.keys()).find_map(|key| {
                between(&format!("{path}{dot}{key}"), &value(p, key), &value(q, key))
            })
        }
        (Value::Array(p), Value::Array(q)) if p.len() == q.len() => p
            .iter()
            .zip(q)
            .enumerate()
            .find_map(|(i, (p, q))| between(&format!("{path}[{i}]"), p, q)),
        _ => Some(format!("{path}: {} against {}", shown(first), shown(second))),
    }
}

fn shown(value: &Value) -> String {
    let text = if value.is_null() { "the default".to_owned() } else { value.to_string() };
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_first_difference_is_named_by_its_path() {
        let base =
            json!({ "seed": 1, "sets": [{ "name": "a" }, { "name": "b", "views": [1, 2] }] });
        assert_eq!(difference(&base, &base), None);
        for (pointer, value, said) in [
            ("/seed", json!(2), "seed: 1 against 2"),
            ("/sets/1/name", json!("c"), r#"sets[1].name: "b" against "c""#),
            ("/sets/1/views", json!([1]), "sets[1].views: [1,2] against [1]"),
            ("/sets/0", json!({}), r#"sets[0].name: "a" against the default"#),
        ] {
            let mut other = base.clone();
            *other.pointer_mut(pointer).unwrap() = value;
            assert_eq!(difference(&base, &other).unwrap(), said);
        }
    }

    #[test]
    fn long_values_are_cut() {
        let said = difference(&json!({ "beams": vec![1; 1000] }), &json!({})).unwrap();
        assert!(said.len() < 2 * LONGEST && said.ends_with("... against the default"), "{said}");
    }
}
