use std::io::Write;

/// Prints rows of cells with the names of their columns, with the first `n_left` columns aligned to
/// the left and the others to the right.
pub fn print(n_left: usize, rows: &[Vec<(&str, String)>]) -> std::io::Result<()> {
    let header = rows.first().into_iter().map(|row| row.iter().map(|(name, _)| *name).collect());
    let cells = rows.iter().map(|row| row.iter().map(|(_, cell)| &**cell).collect());
    let lines: Vec<Vec<&str>> = header.chain(cells).collect();
    let mut out = std::io::stdout().lock();
    for line in &lines {
        let cells = line.iter().enumerate().map(|(column, cell)| {
            let width = lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
            if column < n_left { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        writeln!(out, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
    }
    Ok(())
}
