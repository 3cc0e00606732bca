//! Circles of dependencies between modules of a crate.
//!
//! A module depends on another if its code names an item that the other defines; re-exports are
//! followed to the definition. Modules of the same parent, each with all modules inside it, must
//! not depend on each other in a circle. A module and the modules inside it may.

use super::modules::{Modules, Name};
use std::collections::{BTreeMap, BTreeSet};

/// The uses of one module by another with the same parent, a line each.
type Uses = BTreeMap<(Name, Name), BTreeSet<String>>;

/// The uses that are part of a circle.
pub fn find(modules: &Modules) -> Vec<String> {
    let uses = uses(modules);
    let in_circles = uses.iter().filter(|((from, to), _)| depends(&uses, to, from));
    in_circles.flat_map(|(_, uses)| uses).cloned().collect()
}

fn uses(modules: &Modules) -> Uses {
    let mut uses = Uses::new();
    for (from, module) in modules {
        // A re-export alone is no dependency.
        let imports = module.imports.values().filter(|import| !import.is_public);
        for path in imports.map(|import| &import.path).chain(module.paths.keys()) {
            let Some((to, item)) = definition(modules, from, path) else { continue };
            let n_shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if n_shared < from.len().min(to.len()) {
                let siblings = (from[..=n_shared].to_vec(), to[..=n_shared].to_vec());
                let line = format!("{} uses {item} of {}", from.join("::"), to.join("::"));
                uses.entry(siblings).or_default().insert(line);
            }
        }
    }
    uses
}

/// The module that defines the item that `path` names in module `from`, and the item's name;
/// `None` if another crate defines it.
fn definition(modules: &Modules, from: &[String], path: &[String]) -> Option<(Name, String)> {
    // Modules may import all names of each other.
    const MOST_IMPORTS: u32 = 8;
    follow(modules, from, path, MOST_IMPORTS)
}

fn follow(
    modules: &Modules,
    from: &[String],
    path: &[String],
    most_imports: u32,
) -> Option<(Name, String)> {
    let module = modules.get(from)?;
    let (first, rest) = path.split_first()?;
    match first.as_str() {
        "crate" => return follow(modules, &[], rest, most_imports),
        "self" => return follow(modules, from, rest, most_imports),
        "super" => return follow(modules, from.split_last()?.1, rest, most_imports),
        _ => {}
    }
    if module.items.contains(first) {
        return Some((from.to_vec(), first.clone()));
    }
    if module.children.contains(first) {
        return follow(modules, &[from, &path[..1]].concat(), rest, most_imports);
    }
    let most_imports = most_imports.checked_sub(1)?;
    if let Some(import) = module.imports.get(first) {
        return follow(modules, from, &[&import.path, rest].concat(), most_imports);
    }
    let mut globs = module.globs.iter();
    globs.find_map(|glob| follow(modules, from, &[glob, path].concat(), most_imports))
}

/// Whether `from` depends on `on`, directly or not.
fn depends(uses: &Uses, from: &Name, on: &Name) -> bool {
    let (mut reached, mut ahead) = (BTreeSet::new(), vec![from]);
    while let Some(module) = ahead.pop() {
        let next = uses.keys().filter(|(user, _)| user == module).map(|(_, used)| used);
        ahead.extend(next.filter(|used| reached.insert(*used)));
    }
    reached.contains(on)
}
