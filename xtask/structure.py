"""Checks of the source that neither rustc nor Clippy makes, a step of `cargo xtask test`: prints a line for each fault.

Links lead to files, merges left no markers, libraries have no handle of the terminal and turn on their lints, `unsafe`
code is where CONTRIBUTING.md says, modules do not depend on each other in circles, pages name the keys of TOML files,
and no crate outgrows its budget of lines.
"""

import doctest
import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import modules

ROOT = Path(__file__).resolve().parents[1]
BUDGET = "xtask/budget.toml"
# Programs, their commands, and tests. Clippy finds `println!` and its like in the rest.
MAY_PRINT = r"(edgepuck|infer-cpu/src/cli|infer-cpu/src/main\.rs|tests|train/src/cli|xtask)(/|$)"
HANDLES = re.compile(r"io::stdout|io::stderr|stdout\(\)|stderr\(\)")
# What the root of each library turns on, but for those of tests and of developers' programs.
LINTS = ("clippy::disallowed_methods", "clippy::print_stdout", "clippy::print_stderr")

# Pages about TOML files, and the folders and files of the types that read them.
PAGES = (
    (("scene-reference.md", "sensor-reference.md"), ("sim-gpu/src/*.rs", "sim-gpu/mesh/src/*.rs")),
    (("scene-recipe-reference.md",), ("sim-gpu/scenes/src/*.rs", "sim-gpu/shapes/src/objects/mod.rs")),
    (("train-recipe-reference.md",), ("train/src/*.rs", "formats/src/model_card.rs")),
)


def tracked(pattern):
    """The files that Git tracks and that are there."""
    listed = subprocess.run(["git", "ls-files", pattern], cwd=ROOT, capture_output=True, text=True, check=True)
    return [file for file in listed.stdout.splitlines() if (ROOT / file).is_file()]


def read(file):
    return (ROOT / file).read_text(encoding="utf-8")


def targets(text):
    """The files that `[text](file#section)` names, without those of other sites and code.

    >>> targets("[a](b.md#c), ![d](e/f.png) and [g](https://h) [i](#j)\\n```sh\\n[k](l)\\n```\\n[m](n)")
    ['b.md', 'e/f.png', 'n']
    """
    prose = "".join(text.split("```")[::2])
    return [target for target in re.findall(r"\]\(([^)# ]+)", prose) if "://" not in target]


def leads(file, target):
    """Whether the link `target` in `file` leads to something that is there.

    >>> [leads("docs/src/view.md", target) for target in ("street.png", "docs/src/street.png", "none.png")]
    [True, False, False]
    """
    return ((ROOT / file).parent / target).exists()


def broken_links():
    contents = targets(read("docs/src/SUMMARY.md"))
    for file in tracked("*.md"):
        for target in targets(read(file)):
            if not leads(file, target):
                yield f"{file} links to {target}, which is missing"
        page = file.removeprefix("docs/src/")
        if page not in (file, "SUMMARY.md", *contents):
            yield f"docs/src/SUMMARY.md leaves out {page}"


def markers(text):
    """The numbers of the lines that begin or end the two sides of a conflict.

    >>> markers("a\\n<<<<<<< HEAD\\nb\\n=======\\n>>>>>>> c\\n  <<<<<<< d\\nTitle\\n=======\\n")
    [2, 5]
    """
    return [number for number, line in enumerate(text.splitlines(), 1) if line.startswith(("<<<<<<< ", ">>>>>>> "))]


def conflicts():
    for file in tracked("."):
        try:
            text = read(file)
        except UnicodeDecodeError:
            continue
        for number in markers(text):
            yield f"{file}:{number} is a marker of a conflict"


def handles(file, text):
    """The lines of a library, without its unit tests, that have a handle of the terminal.

    >>> code = "fn f() {\\n    io::stderr();\\n}\\n// stdout()\\n#[cfg(test)]\\nmod tests { stdout() }"
    >>> handles("train/src/run.rs", code), handles("train/src/cli/train.rs", code)
    (['train/src/run.rs:2 has io::stderr'], [])
    """
    if re.match(MAY_PRINT, file):
        return []
    lines = enumerate(text.split("#[cfg(test)]\nmod ")[0].splitlines(), 1)
    found = ((number, HANDLES.search(line)) for number, line in lines if not line.lstrip().startswith("//"))
    return [f"{file}:{number} has {handle[0]}" for number, handle in found if handle]


def printing():
    return [fault for file in tracked("*.rs") for fault in handles(file, read(file))]


def turns_on(code, lint):
    """
    >>> turns_on("#![cfg_attr(not(test), warn(clippy::print_stdout))]", "clippy::print_stdout")
    True
    >>> turns_on("// warn(clippy::print_stdout)\\n#![allow(clippy::print_stdout)]", "clippy::print_stdout")
    False
    """
    return any(line.startswith("#![") and "warn(" in line and lint in line for line in code.splitlines())


def lints():
    for file in tracked("*src/lib.rs"):
        if not re.match("(tests|xtask)/", file):
            code = read(file)
            yield from (f"{file} does not warn of {lint}" for lint in LINTS if not turns_on(code, lint))


def allows_unsafe(code):
    """Whether an attribute overrules `unsafe_code = "deny"`.

    >>> [allows_unsafe(code) for code in (
    ...     '#![allow(unsafe_code, reason = "(fast)")]', '#[expect(\\n    dead_code,\\n    unsafe_code,\\n)]',
    ...     "#![cfg_attr(not(test), allow(unsafe_code))]", "#![deny(unsafe_code)]\\n#![allow(dead_code)]")]
    [True, True, True, False]
    """
    return re.search(r'(allow|expect|warn)\([^)"]*unsafe_code', code) is not None


def unnamed(allowed, contributing):
    """The differences of the files that allow `unsafe` code from the places that the paragraph about it names.

    >>> text = "# A\\n\\n- **`unsafe` blocks** say why. Only `ffi` and\\n  `a/b.rs` may.\\n- **`x`** may.\\n"
    >>> unnamed(["ffi/src/lib.rs", "a/b.rs", "a/tests/c.rs"], text)
    []
    >>> unnamed(["ffi/src/lib.rs", "a/c.rs"], text)
    ['a/c.rs allows unsafe_code, which CONTRIBUTING.md does not', 'CONTRIBUTING.md lets a/b.rs have unsafe code']
    """
    (paragraph,) = (part for part in contributing.split("\n- ") if part.lstrip("- ").startswith("**`unsafe` blocks**"))
    named = paragraph.split("`")[3::2]

    def lies_in(file, place):
        return Path(file).is_relative_to(place)

    others = [f for f in allowed if "tests" not in Path(f).parts and not any(lies_in(f, place) for place in named)]
    unused = [place for place in named if not any(lies_in(file, place) for file in allowed)]
    return [f"{file} allows unsafe_code, which CONTRIBUTING.md does not" for file in others] + [
        f"CONTRIBUTING.md lets {place} have unsafe code" for place in unused
    ]


def unsafe_code():
    return unnamed([file for file in tracked("*.rs") if allows_unsafe(read(file))], read("CONTRIBUTING.md"))


def circles():
    metadata = ["cargo", "metadata", "--no-deps", "--format-version", "1"]
    described = subprocess.run(metadata, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout
    for target in (target for package in json.loads(described)["packages"] for target in package["targets"]):
        if target["kind"][0] not in ("test", "example", "bench", "custom-build"):
            file = Path(target["src_path"])
            crate = modules.Reader().module((), file.parent, modules.trees(read(file)))
            yield from (f"{target['name']}: {use}" for use in modules.circles(crate.modules))


def keys():
    for pages, sources in PAGES:
        text = "".join(read(f"docs/src/{page}") for page in pages)
        named = {key for key in re.findall(r"^\| `([^`]*)", text, re.MULTILINE) if not key.startswith('"')}
        files = [file for pattern in sources for file in tracked(pattern)]
        # The plan of `corrupt` is a file of the repository.
        codes = (read(file) for file in files if not file.endswith("/corruption.rs"))
        are_read = set().union(*map(modules.keys, codes))
        yield from (f"{pages} leave out {key}" for key in sorted(are_read - named))
        yield from (f"{pages} name {key}, which is not read" for key in sorted(named - are_read))


def budget():
    """The lines of each crate's tracked files of Rust, beside the most that it may have."""
    entries = re.findall(r'^"(.+)" = (\d+)$', read(BUDGET), re.MULTILINE)
    most = {crate: int(number) for crate, number in entries}
    lines = Counter()
    for file in tracked("*.rs"):
        crate = next(folder for folder in Path(file).parents if (ROOT / folder / "Cargo.toml").exists())
        lines[crate.as_posix()] += len(read(file).splitlines())
    lines["sum"] = sum(lines.values())
    for crate in sorted(lines | most):
        print(f"{crate:22} {lines[crate]:>7} of {most.get(crate, 'none'):>7} lines", file=sys.stderr)
        if crate not in lines:
            yield f"{BUDGET} names {crate}, which has no lines of Rust"
        elif lines[crate] > most.get(crate, 0):
            yield f"{crate} has {lines[crate]} lines of Rust, and may have {most.get(crate, 0)}: {BUDGET} says how many"


def main():
    n_faults = doctest.testmod().failed + doctest.testmod(modules).failed
    for check in (budget, conflicts, broken_links, lints, printing, unsafe_code, circles, keys):
        for fault in check():
            print(f"{check.__name__}: FAILED, {fault}")
            n_faults += 1
    sys.exit(n_faults > 0)


if __name__ == "__main__":
    main()
