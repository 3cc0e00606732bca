//! Words in drawings.

use svg::node::element::Text;

/// `words` that begin at `x` on the line `y`, `size` pixels high.
pub(crate) fn text(words: &str, x: f64, y: f64, size: u32) -> Text {
    Text::new(words).set("x", x).set("y", y).set("font-family", "sans-serif").set("font-size", size)
}
