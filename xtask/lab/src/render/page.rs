//! Pages that need nothing else: one HTML file with its styles, its drawings
//! and what little script it has.

use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("../../../../assets/page/page.css");
const TABS: &str = include_str!("../../../../assets/page/page.js");
const CLOUDS: &str = include_str!("../../../../assets/page/cloud.js");

/// One chapter of a page.
pub struct Chapter {
    /// What links to it: letters and hyphens.
    pub id: &'static str,
    /// What its tab says.
    pub title: &'static str,
    /// What it shows.
    pub body: Markup,
}

/// A page of `chapters`, one shown at a time, under `lead`.
pub fn of(title: &str, lead: &Markup, chapters: &[Chapter]) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (title) }
                (lead)
                div role="tablist" { @for chapter in chapters {
                    button type="button" role="tab" data-tab=(chapter.id) aria-controls=(chapter.id) {
                        (chapter.title)
                    }
                } }
                @for chapter in chapters {
                    section id=(chapter.id) role="tabpanel" { h2 { (chapter.title) } (chapter.body) }
                }
                div id="tip" role="tooltip" hidden {}
                script { (PreEscaped(CLOUDS)) }
                script { (PreEscaped(TABS)) }
            }
        }
    };
    page.into_string()
}

/// A drawing as part of a page.
pub fn figure(svg: &str, caption: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) figcaption { (caption) } } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_needs_nothing_else_and_escapes_names() {
        let body = html! { p { "a < b" } };
        let page = of("T & T", &html! {}, &[Chapter { id: "one", title: "One", body }]);
        assert!(page.contains("a &lt; b") && page.contains("T &amp; T"));
        assert!(page.contains(r#"data-tab="one""#) && page.contains(r#"<section id="one""#));
        for outside in ["http://", "https://", "src=", "@import"] {
            assert!(!page.contains(outside), "{outside}");
        }
    }
}
