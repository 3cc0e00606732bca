"""The reference of the package in the documentation, made from the docstrings.

`UPDATE_GOLDEN=1` writes the page anew.
"""

import ast
import inspect
import os
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path

import edgepuck

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "python/edgepuck"
PAGE = ROOT / "docs/src/python-reference.md"
# Modules that need another package, beside the package itself.
OPTIONAL = ["torch", "onnx", "mujoco", "gymnasium"]
BEGIN = """# Python reference

`import edgepuck as ep`. Lengths are in metres, angles in degrees and times in seconds; poses are matrices [4, 4]. In the
frames of the world and of sensors z points up, and sensors look along x. A value, a file or a mesh that cannot be used
raises `ep.Error`, a `ValueError`, which names it and says why.

<!-- Made from the docstrings: UPDATE_GOLDEN=1 python -m pytest python/tests/test_reference.py -->
"""

Documented = ast.ClassDef | ast.FunctionDef


def test_the_page_has_every_public_name_with_its_docstring() -> None:
    page = "\n".join([BEGIN, *of_package(), *of_optional_modules()])
    if os.environ.get("UPDATE_GOLDEN"):
        PAGE.write_text(page)
    assert PAGE.read_text() == page, "UPDATE_GOLDEN=1 writes the page anew"


def of_package() -> Iterator[str]:
    defined = {}
    for file in [*PACKAGE.glob("_*.py"), PACKAGE / "_edgepuck.pyi"]:
        for node in public(ast.parse(file.read_text())):
            defined.setdefault(node.name, node)
    for name in edgepuck.__all__:
        yield from section(defined[name], f"ep.{name}")


def of_optional_modules() -> Iterator[str]:
    for module in OPTIONAL:
        for node in public(ast.parse((PACKAGE / f"{module}.py").read_text())):
            yield from section(node, f"edgepuck.{module}.{node.name}")


def public(node: ast.Module | ast.ClassDef) -> list[Documented]:
    nodes = (node for node in node.body if isinstance(node, Documented))
    return [node for node in nodes if not node.name.startswith("_")]


def section(node: Documented, name: str) -> Iterator[str]:
    yield f"## `{name}`\n"
    if isinstance(node, ast.FunctionDef):
        yield f"`{signature(node, name)}`\n"
    else:
        made = [one for one in node.body if isinstance(one, ast.FunctionDef) and one.name == "__init__"]
        yield from (f"`{signature(one, name)}`\n" for one in made)
    # The docs of the compiled module are not in its stubs.
    yield text(doc(node) or inspect.getdoc(getattr(edgepuck, node.name)))
    if isinstance(node, ast.ClassDef):
        yield from members(node, name)


def members(node: ast.ClassDef, name: str) -> Iterator[str]:
    fields = [*annotated(node), *((one.name, doc(one)) for one in public(node) if is_property(one))]
    if fields:
        yield "Attributes:\n"
        yield "".join(f"- `{field}`: {on_one_line(words)}\n" for field, words in fields)
    for one in node.body:
        is_public = isinstance(one, ast.FunctionDef) and (one.name[0] != "_" or one.name == "__call__")
        if is_public and not is_property(one) and not decorated(one, "overload"):
            yield f"### `{name}.{one.name}`\n\n`{signature(one, one.name)}`\n"
            yield text(doc(one))


def annotated(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    """Fields with the strings that follow them."""
    for field, words in zip(node.body, node.body[1:]):
        if isinstance(field, ast.AnnAssign) and isinstance(words, ast.Expr):
            yield ast.unparse(field.target), ast.literal_eval(words.value)


def is_property(node: Documented) -> bool:
    return decorated(node, "property")


def decorated(node: Documented, by: str) -> bool:
    return any(isinstance(one, ast.Name) and one.id == by for one in node.decorator_list)


def signature(node: ast.FunctionDef, name: str) -> str:
    every = node.args
    every.args = [one for one in every.args if one.arg not in ("self", "cls")]
    for one in [*every.args, *every.kwonlyargs, every.vararg, every.kwarg]:
        if one is not None:
            one.annotation = None
    return f"{name}({ast.unparse(every)})"


def doc(node: Documented) -> str:
    return ast.get_docstring(node) or ""


def on_one_line(words: str) -> str:
    return " ".join(inspect.cleandoc(words).split())


def text(words: str | None) -> str:
    """A docstring as Markdown: lists of arguments and errors, without examples."""
    assert words, "expected a docstring, found none"
    paragraphs = re.split(r"\n\n+", words)
    return "\n".join(map(paragraph, (one for one in paragraphs if not one.startswith(">>>"))))


def paragraph(words: str) -> str:
    head, _, rest = words.partition("\n")
    if head == "Returns:":
        return f"Returns: {on_one_line(rest)}\n"
    if head not in ("Args:", "Raises:"):
        return f"{words}\n"
    items = re.split(r"\n(?=\S)", textwrap.dedent(rest))
    documented = (item.partition(": ") for item in items)
    listed = "".join(f"- `{name}`: {on_one_line(what)}\n" for name, _, what in documented)
    return f"{'Arguments' if head == 'Args:' else 'Errors'}:\n\n{listed}"
