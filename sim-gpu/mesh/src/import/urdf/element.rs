//! The attributes of XML elements, with the lines of their faults.

use glam::{DAffine3, DQuat, EulerRot};
use roxmltree::Node;

use crate::import::shapes::LARGEST_RADIUS_M;
use crate::{Malformed, ParseError};

/// A fault of an element, with its line.
pub fn fault(of: Node<'_, '_>, cause: String) -> ParseError {
    let row = of.document().text_pos_at(of.range().start).row;
    Malformed::Syntax(cause).at(row as usize)
}

/// The same fault, of a part of the `kind` called `name`.
pub fn within(kind: &str, name: &str, error: ParseError) -> ParseError {
    ParseError { cause: Malformed::Syntax(format!("{kind} {name:?}: {}", error.cause)), ..error }
}

pub fn child<'a>(of: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    of.children().find(|node| node.has_tag_name(name))
}

pub fn required<'a>(of: Node<'a, 'a>, name: &str) -> Result<Node<'a, 'a>, ParseError> {
    child(of, name).ok_or_else(|| fault(of, format!("expected the element {name}, found none")))
}

pub fn attribute<'a>(of: Node<'a, 'a>, name: &str) -> Result<&'a str, ParseError> {
    let element = of.tag_name().name();
    let missing = || fault(of, format!("{element}: expected the attribute {name}, found none"));
    of.attribute(name).ok_or_else(missing)
}

/// The finite numbers of an attribute, if it is there.
pub fn numbers<const N: usize>(
    of: Node<'_, '_>,
    name: &str,
) -> Result<Option<[f64; N]>, ParseError> {
    let Some(text) = of.attribute(name) else { return Ok(None) };
    let parsed =
        text.split_ascii_whitespace().map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()));
    let found: Option<Vec<f64>> = parsed.collect();
    let found = found.and_then(|found| <[f64; N]>::try_from(found).ok());
    let element = of.tag_name().name();
    let expected =
        if N == 1 { "a finite number".to_owned() } else { format!("{N} finite numbers") };
    let wrong = || fault(of, format!("{element}: expected {expected} as {name}, found {text:?}"));
    found.map(Some).ok_or_else(wrong)
}

/// The lengths of an attribute, all above 0.
pub fn lengths<const N: usize>(of: Node<'_, '_>, name: &str) -> Result<[f64; N], ParseError> {
    let element = of.tag_name().name();
    let found = numbers(of, name)?;
    let found =
        found.ok_or_else(|| fault(of, format!("{element}: expected {name}, found none")))?;
    match found.into_iter().find(|length| *length <= 0.0) {
        Some(length) => {
            Err(fault(of, format!("{element}: expected {name} above 0, found {length}")))
        }
        None => Ok(found),
    }
}

pub fn radius(of: Node<'_, '_>) -> Result<f64, ParseError> {
    let [radius_m] = lengths(of, "radius")?;
    match radius_m <= LARGEST_RADIUS_M {
        true => Ok(radius_m),
        false => {
            let cause = format!("expected a radius up to {LARGEST_RADIUS_M} m, found {radius_m}");
            Err(fault(of, cause))
        }
    }
}

/// The pose of the element `origin`: turned about the fixed axes x, y and z in this order.
pub fn origin<'a>(of: Node<'a, 'a>) -> Result<DAffine3, ParseError> {
    let Some(origin) = child(of, "origin") else {
        return Ok(DAffine3::IDENTITY);
    };
    let position = numbers(origin, "xyz")?.unwrap_or_default();
    let [roll, pitch, yaw] = numbers(origin, "rpy")?.unwrap_or_default();
    let rotation = DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll);
    Ok(DAffine3::from_rotation_translation(rotation, position.into()))
}
