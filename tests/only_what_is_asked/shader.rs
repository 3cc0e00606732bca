//! What the composed shader holds, as naga reads it.

use naga::{Block, Function, Statement};
use sim_gpu::effects::Effects;
use sim_gpu::internals::gpu::compose;
use std::collections::BTreeSet;

use super::Rows;

/// Instructions by function, bindings and constants, and their totals.
pub fn rows(effects: &Effects) -> Rows {
    let wgsl = compose(effects);
    let module = naga::front::wgsl::parse_str(&wgsl)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&wgsl)));
    let mut rows = Rows::new();
    let functions = module.functions.iter().map(|(_, function)| function);
    let entries = module.entry_points.iter().map(|entry| &entry.function);
    let names = module.entry_points.iter().map(|entry| Some(entry.name.clone()));
    let names = module.functions.iter().map(|(_, f)| f.name.clone()).chain(names);
    for (function, name) in functions.chain(entries).zip(names) {
        rows.insert(format!("shader, function {}", name.unwrap()), instructions(function));
    }
    rows.insert("shader, total instructions".to_owned(), rows.values().sum());
    let mut groups = BTreeSet::new();
    let mut bindings = 0;
    for (_, global) in module.global_variables.iter() {
        let Some(binding) = &global.binding else { continue };
        let (group, number, name) = (binding.group, binding.binding, global.name.clone().unwrap());
        rows.insert(format!("shader, group {group} binding {number}: {name}"), 1);
        groups.insert(group);
        bindings += 1;
    }
    for (_, constant) in module.overrides.iter() {
        rows.insert(format!("shader, constant {}", constant.name.clone().unwrap()), 1);
    }
    rows.insert("shader, bind groups".to_owned(), groups.len() as u64);
    rows.insert("shader, total bindings".to_owned(), bindings);
    rows
}

/// Expressions and statements together.
fn instructions(function: &Function) -> u64 {
    function.expressions.len() as u64 + statements(&function.body)
}

fn statements(block: &Block) -> u64 {
    block.iter().map(|statement| 1 + within(statement)).sum()
}

fn within(statement: &Statement) -> u64 {
    match statement {
        Statement::Block(block) => statements(block),
        Statement::If { accept, reject, .. } => statements(accept) + statements(reject),
        Statement::Switch { cases, .. } => cases.iter().map(|case| statements(&case.body)).sum(),
        Statement::Loop { body, continuing, .. } => statements(body) + statements(continuing),
        _ => 0,
    }
}
