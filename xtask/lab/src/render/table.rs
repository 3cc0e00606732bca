//! Tables of a page.

use maud::{Markup, html};

/// Rows of words under headings; rows that are marked are set in bold.
pub fn table(caption: &str, heading: &[&str], rows: &[(bool, Vec<String>)]) -> Markup {
    html! {
        div class="scroll" {
            table {
                caption { (caption) }
                thead { tr { @for word in heading { th scope="col" { (word) } } } }
                tbody { @for (marked, words) in rows {
                    tr { @for (i, word) in words.iter().enumerate() {
                        @if i == 0 { th scope="row" { (word) } }
                        @else { td class=[marked.then_some("front")] { (word) } }
                    } }
                } }
            }
        }
    }
}

/// A CSV file as a table.
///
/// # Errors
/// What is no CSV.
pub fn of_csv(caption: &str, bytes: &[u8]) -> anyhow::Result<Markup> {
    let mut csv = csv::Reader::from_reader(bytes);
    let heading = csv.headers()?.clone();
    let rows: Result<Vec<(bool, Vec<String>)>, csv::Error> = csv
        .records()
        .map(|record| Ok((false, record?.iter().map(str::to_owned).collect())))
        .collect();
    Ok(table(caption, &heading.iter().collect::<Vec<_>>(), &rows?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_csv_file_becomes_rows() {
        let found = of_csv("caption", b"a,b\n1,\"x, y\"\n").unwrap().into_string();
        assert!(found.contains("<th scope=\"col\">a</th>"));
        assert!(found.contains("<th scope=\"row\">1</th>") && found.contains("<td>x, y</td>"));
        assert!(of_csv("caption", b"a,b\n1\n").is_err());
    }
}
