//! The modules of a crate: which items each defines, imports and names.

use super::tokens::{self, Token};
use anyhow::Context;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The names on the way from a crate's root to a module; the root's is empty.
pub type Name = Vec<String>;

/// A path of Rust, such as `crate::mesh::Mesh`.
pub type Words = Vec<String>;

pub type Modules = BTreeMap<Name, Module>;

/// What the source of a module contains, apart from tests.
#[derive(Default)]
pub struct Module {
    pub file: PathBuf,
    pub children: BTreeSet<String>,
    pub items: BTreeSet<String>,
    /// The names that `use` brings into it.
    pub imports: BTreeMap<String, Import>,
    /// The paths before `::*`.
    pub globs: Vec<Words>,
    /// The paths in its code, keywords included, and the line of the first of each.
    pub paths: BTreeMap<Words, usize>,
}

/// A name that `use` brings into a module.
pub struct Import {
    pub path: Words,
    /// Whether other modules can import the name from here.
    pub is_public: bool,
}

impl Module {
    /// The first line of each path in its code that `is_wanted`.
    pub fn lines_with(&self, is_wanted: impl Fn(&[String]) -> bool) -> Vec<String> {
        let paths = self.paths.iter().filter(|(path, _)| is_wanted(path));
        let file = self.file.display();
        paths.map(|(path, line)| format!("{file}:{line} has {}", path.join("::"))).collect()
    }
}

/// Reads the crate whose root is the file `root`.
pub fn read(root: &Path) -> anyhow::Result<Modules> {
    let mut modules = Modules::new();
    let folder = root.parent().unwrap_or(Path::new(""));
    read_file(root, folder, &[], &mut modules)?;
    Ok(modules)
}

/// Adds the module of `file`, and the modules in it, whose files are in `folder`.
fn read_file(
    file: &Path,
    folder: &Path,
    name: &[String],
    modules: &mut Modules,
) -> anyhow::Result<()> {
    let source = fs::read_to_string(file).with_context(|| file.display().to_string())?;
    for child in parse(&source, file, name, modules) {
        let inside = folder.join(child[name.len()..].join("/"));
        let beside = inside.with_extension("rs");
        let file = if beside.exists() { beside } else { inside.join("mod.rs") };
        read_file(&file, &inside, &child, modules)?;
    }
    Ok(())
}

/// Adds the module whose content is `source`, and the modules inside braces in it. Returns the
/// names of the modules in it that have files of their own.
pub fn parse(source: &str, file: &Path, name: &[String], modules: &mut Modules) -> Vec<Name> {
    let mut elsewhere = Vec::new();
    parse_tokens(&tokens::of(source), file, name, modules, &mut elsewhere);
    elsewhere
}

fn parse_tokens(
    tokens: &[Token<'_>],
    file: &Path,
    name: &[String],
    modules: &mut Modules,
    elsewhere: &mut Vec<Name>,
) {
    let mut module = Module { file: file.to_path_buf(), ..Module::default() };
    let text = |at: usize| tokens.get(at).map_or("", |token| token.text);
    let (mut at, mut depth) = (0, 0_u32);
    while at < tokens.len() {
        match text(at) {
            "{" => depth += 1,
            "}" => depth = depth.saturating_sub(1),
            "mod" if matches!(text(at + 2), ";" | "{") => {
                let child = [name, &[text(at + 1).to_owned()]].concat();
                module.children.insert(text(at + 1).to_owned());
                at += 2;
                if text(at) == ";" {
                    elsewhere.push(child);
                } else {
                    let end = at + tokens::block_length(&tokens[at..]) - 1;
                    parse_tokens(&tokens[at + 1..end], file, &child, modules, elsewhere);
                    at = end;
                }
            }
            // `use<'a>` states which lifetimes a type captures.
            "use" if text(at + 1) != "<" => {
                let is_public = at > 0 && matches!(text(at - 1), "pub" | ")");
                let length = tokens[at..].iter().take_while(|token| token.text != ";").count();
                add_imports(&tokens[at + 1..at + length], &[], is_public, &mut module);
                at += length;
            }
            "macro_rules" => {
                module.items.insert(text(at + 2).to_owned());
                at += 2;
            }
            "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static" | "union"
                if depth == 0 && text(at + 1) != "fn" =>
            {
                module.items.insert(text(at + 1).to_owned());
                at += 1;
            }
            word if word.starts_with(tokens::is_word) => {
                let is_start = at == 0 || !matches!(text(at - 1), "." | "::");
                let mut path = vec![word.to_owned()];
                let line = tokens[at].line;
                while text(at + 1) == "::" && text(at + 2).starts_with(tokens::is_word) {
                    path.push(text(at + 2).to_owned());
                    at += 2;
                }
                if is_start {
                    module.paths.entry(path).or_insert(line);
                }
            }
            _ => {}
        }
        at += 1;
    }
    modules.insert(name.to_vec(), module);
}

/// Adds the imports of `tree`, a part of a `use` whose path begins with `prefix`.
fn add_imports(tree: &[Token<'_>], prefix: &[String], is_public: bool, module: &mut Module) {
    let mut path = prefix.to_vec();
    let mut alias = None;
    for (at, token) in tree.iter().enumerate() {
        match token.text {
            "::" => {}
            "{" => {
                for branch in tokens::split_at_commas(&tree[at + 1..tree.len() - 1]) {
                    add_imports(branch, &path, is_public, module);
                }
                return;
            }
            "*" => return module.globs.push(path),
            "as" => {
                alias = tree.get(at + 1);
                break;
            }
            word => path.push(word.to_owned()),
        }
    }
    if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    let name = alias.map(|token| token.text.to_owned()).or_else(|| path.last().cloned());
    if let Some(name) = name {
        module.imports.insert(name, Import { path, is_public });
    }
}
