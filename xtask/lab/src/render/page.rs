//! Self-contained pages: one HTML file with its styles, drawings and scripts.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use pulldown_cmark::{Event, HeadingLevel, Options, Parser, Tag, TagEnd};

const STYLE: &str = include_str!("../../../../assets/page/page.css");
const TABS: &str = include_str!("../../../../assets/page/page.js");
const CLOUDS: &str = include_str!("../../../../assets/page/cloud.js");

pub struct Chapter {
    /// Its anchor: letters and hyphens.
    pub id: String,
    pub tab: String,
    pub title: String,
    pub body: Markup,
}

impl Chapter {
    pub fn new(id: &str, tab: &str, title: &str, body: Markup) -> Self {
        Self { id: id.to_owned(), tab: tab.to_owned(), title: title.to_owned(), body }
    }
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
                        (chapter.tab)
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

/// A cloud that a reader can rotate, above its caption: coordinates in thousandths, a digit for the
/// colour of each point, and the colours that the digits mean.
pub fn cloud(points: &str, colours: &str, palette: &str, caption: &Markup) -> Markup {
    html! {
        figure {
            canvas class="cloud" width="480" height="360" data-points=(points)
                data-colours=(colours) data-palette=(palette) data-radii="1.6 3.4"
                data-elevation="0.35" {}
            figcaption { (caption) }
        }
    }
}

/// A record in Markdown. Its links lead to other files, which a page that is alone does not
/// have: their words stay. Its headings go below those of a chapter.
pub fn markdown(text: &str) -> Markup {
    let lower = |level| match level {
        HeadingLevel::H1 => HeadingLevel::H3,
        HeadingLevel::H2 => HeadingLevel::H4,
        _ => HeadingLevel::H5,
    };
    let parser = Parser::new_ext(text, Options::ENABLE_TABLES);
    let events = parser.filter_map(|event| match event {
        Event::Start(Tag::Link { .. } | Tag::Image { .. })
        | Event::End(TagEnd::Link | TagEnd::Image) => None,
        Event::Start(Tag::Heading { level, id, classes, attrs }) => {
            Some(Event::Start(Tag::Heading { level: lower(level), id, classes, attrs }))
        }
        Event::End(TagEnd::Heading(level)) => Some(Event::End(TagEnd::Heading(lower(level)))),
        // Nothing but Markdown is meant.
        Event::Html(text) | Event::InlineHtml(text) => Some(Event::Text(text)),
        event => Some(event),
    });
    let mut page = String::new();
    pulldown_cmark::html::push_html(&mut page, events);
    let scrolled = page.replace("<table>", r#"<div class="scroll"><table>"#);
    PreEscaped(scrolled.replace("</table>", "</table></div>"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_self_contained_and_escapes_names() {
        let body = html! { p { "a < b" } };
        let page = of("T & T", &html! {}, &[Chapter::new("one", "One", "Which one?", body)]);
        assert!(
            page.contains("<h2>Which one?</h2>")
                && page.contains("a &lt; b")
                && page.contains("T &amp; T")
        );
        assert!(page.contains(r#"data-tab="one""#) && page.contains(r#"<section id="one""#));
        for outside in ["http://", "https://", "src=", "@import"] {
            assert!(!page.contains(outside), "{outside}");
        }
    }

    #[test]
    fn a_record_in_markdown_has_tables_and_no_links() {
        let text = "# Cars\n\n| a | b |\n|---|---|\n| 1 | <b> |\n\nSee [it](https://a.b/c.md).\n";
        let page = markdown(text).into_string();
        for expected in ["<h3>Cars</h3>", "<td>1</td>", "&lt;b&gt;", "<p>See it.</p>"] {
            assert!(page.contains(expected), "{expected}: {page}");
        }
    }
}
