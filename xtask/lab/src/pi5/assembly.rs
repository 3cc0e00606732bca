//! Functions and their loops in an assembly listing of LLVM, for ELF.

#[derive(Debug)]
pub struct Function<'a> {
    pub symbol: &'a str,
    /// Labels, which end in a colon, and instructions.
    lines: Vec<&'a str>,
}

pub fn functions(listing: &str) -> impl Iterator<Item = Function<'_>> {
    // `.type SYMBOL,@function`, `SYMBOL:`, the body, `.size SYMBOL, …`.
    let mut lines = listing.lines();
    std::iter::from_fn(move || {
        let symbol = lines.find_map(|line| {
            line.trim().strip_prefix(".type")?.trim().strip_suffix(",@function")
        })?;
        let head = |line: &&str| line.strip_suffix(':').is_some_and(|label| label == symbol);
        lines.by_ref().find(head)?;
        let body = lines.by_ref().take_while(|line| !line.trim_start().starts_with(".size"));
        Some(Function { symbol, lines: body.filter_map(line).collect() })
    })
}

/// The label or the instruction of one line of a body, which may have neither.
fn line(text: &str) -> Option<&str> {
    let text = text.split("//").next().unwrap_or_default().trim();
    let is_directive = text.starts_with('.') && !is_label(text);
    (!text.is_empty() && !is_directive && !text.starts_with("/*")).then_some(text)
}

fn is_label(line: &str) -> bool {
    line.ends_with(':')
}

impl<'a> Function<'a> {
    /// The loops that hold no other loop, by their instructions. A loop is
    /// what lies between a label and the last branch back to it.
    pub fn innermost_loops(&self) -> Vec<Loop<'a>> {
        let mut ranges: Vec<(usize, usize)> = Vec::new();
        for (end, line) in self.lines.iter().enumerate() {
            let Some(target) = branch_target(line) else { continue };
            let is_target = |line: &&str| line.strip_suffix(':') == Some(target);
            let Some(start) = self.lines[..end].iter().position(is_target) else { continue };
            match ranges.iter_mut().find(|range| range.0 == start) {
                Some(range) => range.1 = end,
                None => ranges.push((start, end)),
            }
        }
        let inner = |&&(start, end): &&(usize, usize)| {
            !ranges.iter().any(|&other| other != (start, end) && start <= other.0 && other.1 <= end)
        };
        let lines = |&(start, end): &(usize, usize)| Loop(self.lines[start..=end].to_vec());
        ranges.iter().filter(inner).map(lines).collect()
    }
}

/// Where a branch goes; `None` for other instructions, calls among them.
fn branch_target(instruction: &str) -> Option<&str> {
    let (mnemonic, operands) = instruction.split_once(char::is_whitespace)?;
    let branches = matches!(mnemonic, "b" | "cbz" | "cbnz" | "tbz" | "tbnz");
    (branches || mnemonic.starts_with("b.")).then(|| operands.rsplit(',').next())?.map(str::trim)
}

#[derive(Clone, Debug)]
pub struct Loop<'a>(Vec<&'a str>);

impl<'a> Loop<'a> {
    pub fn instructions(&self) -> impl Iterator<Item = &'a str> {
        self.0.iter().copied().filter(|line| !is_label(line))
    }

    /// How many of its instructions have this mnemonic and, in their first
    /// operand, vectors of this arrangement (`4s`).
    pub fn count(&self, mnemonic: &str, arrangement: &str) -> usize {
        let counts = |text: &&str| {
            let Some((name, operands)) = text.split_once(char::is_whitespace) else { return false };
            let first = operands.split(',').next().unwrap_or_default().trim();
            name == mnemonic && first.split_once('.').is_some_and(|(_, lanes)| lanes == arrangement)
        };
        self.instructions().filter(counts).count()
    }

    pub fn has(&self, mnemonic: &str) -> bool {
        self.instructions().any(|text| text.split_whitespace().next() == Some(mnemonic))
    }

    pub fn text(&self) -> String {
        self.0.join("\n") + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTING: &str = include_str!("tile.s");

    #[test]
    fn finds_the_innermost_loop_by_its_branch_back() {
        let tile = functions(LISTING).next().unwrap();
        let loops = tile.innermost_loops();
        assert_eq!(loops.len(), 1);
        let text = loops[0].text();
        assert!(text.starts_with(".LBB0_2:\nldr\tq0"), "{text}");
        assert!(text.ends_with("\nb.lo\t.LBB0_2\n"), "{text}");
        assert_eq!(loops[0].instructions().count(), 7);
    }

    #[test]
    fn counts_instructions_by_their_lanes() {
        let tile = functions(LISTING).next().unwrap();
        let inner = &tile.innermost_loops()[0];
        assert_eq!(inner.count("fmla", "4s"), 1);
        assert_eq!(inner.count("fmla", "8h"), 1);
        assert_eq!(inner.count("fmla", "2d"), 0);
        assert!(inner.has("prfm") && !inner.has("subs"));
    }
}
