"""What checks of the structure read of Rust's source: circles of dependencies between modules, and keys of TOML files.

A module depends on another if its code names an item that the other defines; re-exports are followed to the definition.
Modules of the same parent, each with all modules inside it, must not depend on each other in a circle. A module and the
modules inside it may. Tests do not count.
"""

import re
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

TOKEN = re.compile(
    r"""(?P<space>\s+|//[^\n]*|/\*.*?\*/)
    |(?P<token>[bc]?r(?P<hashes>\#*)".*?"(?P=hashes) | [bc]?"(?:\\.|[^"\\])*" | b?'(?:\\[^u]\w*|\\u[^']*|[^'\\])'
    |'\w+ | (?:r\#)?[A-Za-z_]\w* | \d\w* | :: | \.\.=? | .)""",
    re.DOTALL | re.VERBOSE,
)
CLOSING = {"(": ")", "[": "]", "{": "}"}
NAMED = {"const", "enum", "fn", "static", "struct", "trait", "type"}


def trees(source):
    """The tokens of `source`; those in brackets are a tuple of the opening bracket and their list.

    >>> trees("f('a', \\"(\\"); // )")
    ['f', ('(', ["'a'", ',', '"("']), ';']
    """
    outer = [("", [])]
    for match in TOKEN.finditer(source):
        token = match["token"]
        if token in CLOSING:
            outer.append((token, []))
        elif token in CLOSING.values():
            group = outer.pop()
            assert CLOSING[group[0]] == token, f"{token} closes {group[0]}"
            outer[-1][1].append(group)
        elif token:
            outer[-1][1].append(token)
    return outer[0][1]


def opens(tree, bracket):
    return isinstance(tree, tuple) and tree[0] == bracket


def is_word(tree):
    return isinstance(tree, str) and tree.isidentifier()


def flat(tree):
    """The tokens in a tree, without brackets, each behind a space."""
    return f" {tree}" if isinstance(tree, str) else "".join(map(flat, tree[1]))


def attributes(tokens, start):
    """The attributes from there on, each as [`flat`] writes it, and the place behind them."""
    found = []
    while tokens[start : start + 1] == ["#"] and start + 1 < len(tokens):
        start += 1 + (tokens[start + 1] == "!")
        found.append(flat(tokens[start]).strip())
        start += 1
    return found, start


def is_test(found):
    """
    >>> [is_test([text]) for text in ("test", "cfg test", "cfg all test , unix", "cfg any test , unix", "cfg not test")]
    [True, True, True, False, False]
    """
    return any(text in ("test", "cfg test") or text.startswith("cfg all test") for text in found)


def item_end(tokens, start):
    """The place behind the item that starts there."""
    ends = ";" if {"use", "static"} & {*map(str, tokens[start : start + 3])} else "};"
    while start < len(tokens):
        tree, start = tokens[start], start + 1
        if tree == ";" or "}" in ends and opens(tree, "{"):
            break
    return start


@dataclass
class Module:
    """What the source of a module contains, apart from tests."""

    children: set = field(default_factory=set)
    items: set = field(default_factory=set)
    # The paths of the names that `use` brings into it, and whether other modules can import them from here.
    imports: dict = field(default_factory=dict)
    # The paths before `::*`.
    globs: list = field(default_factory=list)
    # The paths in its code.
    paths: set = field(default_factory=set)

    def bring(self, tokens, path, is_public):
        """Adds what a tree of `use` brings, below `path`."""
        words = [tree for tree in tokens if tree != "::"]
        for index, tree in enumerate(words):
            if opens(tree, "{"):
                for one in split(tree[1]):
                    self.bring(one, path, is_public)
                return
            if tree == "*":
                self.globs.append(path)
                return
            if tree == "as":
                self.imports[words[index + 1]] = (path, is_public)
                return
            if tree != "self" or not path:
                path = (*path, tree)
        if path:
            self.imports[path[-1]] = (path, is_public)


def split(tokens):
    """The parts between commas."""
    parts = [[]]
    for tree in tokens:
        if tree == ",":
            parts.append([])
        else:
            parts[-1].append(tree)
    return [part for part in parts if part]


class Reader:
    """Reads all modules of a crate, by their names: the names on the way to each from the crate's root."""

    def __init__(self):
        self.modules = {}

    def module(self, name, folder, tokens):
        self.modules[name] = Module()
        self.code(name, folder, tokens)
        return self

    def code(self, name, folder, tokens, has_methods=False):
        """Adds what these tokens of a module name."""
        module, index, before = self.modules[name], 0, "{"
        while index < len(tokens):
            if tokens[index] == "#":
                found, index = attributes(tokens, index)
                if is_test(found):
                    index, before = item_end(tokens, index), ";"
                continue
            tree, rest = tokens[index], tokens[index + 1 : index + 3]
            start, index = index, index + 1
            if isinstance(tree, tuple):
                self.code(name, folder, tree[1])
            elif tree == "mod" and is_word(rest[0]):
                self.inner(name, folder, rest)
                index += 2
            elif tree == "use" and rest[0] != "<":
                end = item_end(tokens, start)
                is_public = before == "pub" or opens(before, "(") and tokens[start - 2] == "pub"
                module.bring(tokens[index : end - 1], (), is_public)
                index = end
            elif tree == "trait" or tree == "impl" and (before in ("{", ";", "unsafe") or opens(before, "{")):
                # Its functions, types and constants are no items of the module.
                end = item_end(tokens, start)
                module.items.update(rest[:1] if tree == "trait" else [])
                self.code(name, folder, tokens[index : end - 1])
                self.code(name, folder, tokens[end - 1][1], has_methods=True)
                index = end
            elif is_word(tree) and before not in (".", "::"):
                if tree in NAMED and rest and is_word(rest[0]) and not has_methods:
                    module.items.add(rest[0])
                elif tree == "macro_rules":
                    module.items.add(rest[1])
                path = [tree]
                while tokens[index : index + 1] == ["::"] and is_word(tokens[index + 1]):
                    path.append(tokens[index + 1])
                    index += 2
                # Not the names of fields.
                if tokens[index : index + 1] != [":"]:
                    module.paths.add(tuple(path))
            before = tokens[index - 1]

    def inner(self, name, folder, rest):
        child, content = rest
        inside = folder / child
        if not opens(content, "{"):
            beside = inside.with_suffix(".rs")
            source = (beside if beside.exists() else inside / "mod.rs").read_text(encoding="utf-8")
            content = ("{", trees(source))
        self.module((*name, child), inside, content[1])
        self.modules[name].children.add(child)


def definition(modules, start, path, most_imports=8):
    """The module that defines the item that `path` names in module `start`, and the item's name; `None` if another crate
    defines it, or if more than `most_imports` imports lead to it: modules may import all names of each other.
    """
    module = modules.get(start)
    if module is None or not path:
        return None
    first, rest = path[0], path[1:]
    if first in ("crate", "self", "super"):
        above = {"crate": (), "self": start, "super": start[:-1]}[first]
        return definition(modules, above, rest, most_imports)
    if first in module.items:
        return start, first
    if first in module.children:
        return definition(modules, (*start, first), rest, most_imports)
    if most_imports == 0:
        return None
    if first in module.imports:
        return definition(modules, start, module.imports[first][0] + rest, most_imports - 1)
    found = (definition(modules, start, glob + path, most_imports - 1) for glob in module.globs)
    return next(filter(None, found), None)


def uses(modules):
    """The uses of one module by another with the same parent, a line each."""
    lines = defaultdict(set)
    for user, module in modules.items():
        # A re-export alone is no dependency.
        imports = {path for path, is_public in module.imports.values() if not is_public}
        for path in imports | module.paths:
            used, item = definition(modules, user, path) or (user, "")
            n_shared = next((i for i, (a, b) in enumerate(zip(user, used)) if a != b), None)
            if n_shared is not None:
                line = f"{'::'.join(user)} uses {item} of {'::'.join(used)}"
                lines[user[: n_shared + 1], used[: n_shared + 1]].add(line)
    return lines


def depends(uses, user, used):
    """Whether `user` depends on `used`, directly or not."""
    reached, ahead = set(), [user]
    while ahead:
        module = ahead.pop()
        new = {to for by, to in uses if by == module} - reached
        reached |= new
        ahead += new
    return used in reached


def circles(modules):
    """The uses that are part of a circle.

    >>> def of(source):
    ...     return circles(Reader().module((), Path(), trees(source)).modules)
    >>> print(*of('''
    ...     pub mod mesh { pub mod read { pub struct Reader; fn f() { crate::scene::new(); } } }
    ...     pub use mesh::read::Reader;
    ...     mod scene { use crate::{Reader as R, pose::Pose}; pub fn new() -> R { R } }
    ...     mod pose { pub struct Pose; }
    ...     mod a { pub fn f() { assert!(crate::b::g(1)); } }
    ...     mod b { pub fn g(i: u8) { super::a::f() } }
    ...     mod c { pub trait C {} impl crate::d::D for u8 {} }
    ...     mod d { pub trait D {} impl crate::c::C for u8 {} }'''), sep="\\n")
    a uses g of b
    b uses f of a
    c uses D of d
    d uses C of c
    mesh::read uses new of scene
    scene uses Reader of mesh::read

    Tests, comments, texts, parents and exports make none:

    >>> of('''mod a { pub struct A; #[cfg(test)] mod tests { use crate::b::B; } impl A { #[test] fn t() { crate::b::B } }
    ...         // crate::b::B
    ...         const TEXT: &str = r#" " crate::b::B "#; const QUOTE: char = '"'; }
    ...     mod b { pub use crate::a::A; pub struct B<'a>(&'a A); pub use inside::C;
    ...             mod inside { pub struct C(super::B); } fn f(c: C) {} }''')
    []

    Methods do not hide what a module imports by their names:

    >>> of('''mod a { use crate::b::g; pub struct A; impl A { fn g(&self) { g(self.g()) } } }
    ...     mod b { pub fn g() -> super::a::A { x.f } }''')
    ['a uses g of b', 'b uses A of a']
    """
    lines = uses(modules)
    return sorted(line for (user, used) in lines if depends(lines, used, user) for line in lines[user, used])


def keys(source):
    """The keys of all types that serde reads, and that know all of their keys.

    >>> sorted(keys('''
    ...     #[serde(deny_unknown_fields)] pub struct A<'a> { #[serde(default)] pub b: Map<u8, u8>, #[serde(skip)] c: u8 }
    ...     #[derive(D)] #[serde(tag = "t", deny_unknown_fields)] enum E { F { #[serde(rename = "g")] h: u8 }, I(u8), J }
    ...     struct K { l: u8 }'''))
    ['b', 'g']
    """
    tokens, index, found = trees(source), 0, set()
    while index < len(tokens):
        of_item, start = attributes(tokens, index)
        index = item_end(tokens, start)
        if any(text.startswith("serde ") and "deny_unknown_fields" in text for text in of_item):
            body = tokens[index - 1][1]
            is_enum = "enum" in tokens[start : start + 3]
            variants = [tree[1] for tree in body if opens(tree, "{")] if is_enum else [body]
            found.update(key for fields in variants for key in map(key_of, split(fields)) if key)
    return found


def key_of(tokens):
    """The key of a field that serde reads; `None` for other parts of a type."""
    found, start = attributes(tokens, 0)
    serde = " ,".join(text.removeprefix("serde") for text in found if text.startswith("serde "))
    if {"skip", "flatten"} & {word.strip() for word in serde.split(",")}:
        return None
    words = [tree for tree in tokens[start:] if not opens(tree, "(") and tree != "pub"]
    renamed = re.search(r'\brename = "([^"]*)"', serde)
    is_field = words[1:2] == [":"] and is_word(words[0])
    return (renamed[1] if renamed else words[0]) if is_field else None
