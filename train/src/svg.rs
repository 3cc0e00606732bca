//! Parts of drawings in SVG.

/// A drawing of `parts` on a white background, `width` by `height` pixels.
pub(crate) fn drawing(width: f64, height: f64, parts: &str) -> String {
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}'>\n\
         <rect width='{width}' height='{height}' fill='white'/>\n{parts}</svg>\n"
    )
}

/// `words` that begin at `x` on the line `y`, `size` pixels high, with further `attributes`.
pub(crate) fn text(words: &str, x: f64, y: f64, size: u32, attributes: &str) -> String {
    let words = words.replace('&', "&amp;").replace('<', "&lt;");
    format!(
        "<text x='{x}' y='{y}' font-family='sans-serif' font-size='{size}' {attributes}>{words}\
         </text>\n"
    )
}
