"""Runs every code block of the pages, in the order in which a reader meets them.

Each page is followed from its beginning in an empty folder of its own:

- `sh`: run by bash, which ends at the first command that fails;
- `text`: what the `sh` block before it prints to standard output, with `...` for what differs;
- `python`: run, or with `>>>` compared with the answers that it shows;
- `toml`: a file, whose name is the comment in its first line.

A block of another language, or of none, fails, so that none is left out.
"""

import doctest
import importlib.util
import os
import re
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from sybil import Document, Example, Region, Sybil
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser, SkipParser

DIFFERENCES = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
# The longest time of a block.
LONGEST_S = 300
LANGUAGES = ["sh", "text", "python", "toml"]


def sh(example: Example) -> None:
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", example.parsed], capture_output=True, text=True, timeout=LONGEST_S
    )
    assert done.returncode == 0, f"{example.parsed}\n{done.stdout}\n{done.stderr}"
    example.namespace["printed"] = done.stdout


def text(example: Example) -> None:
    printed, checker = example.namespace.pop("printed"), doctest.OutputChecker()
    shown = doctest.Example("", example.parsed)
    if not checker.check_output(shown.want, printed, DIFFERENCES):
        raise AssertionError(checker.output_difference(shown, printed, DIFFERENCES))


def toml(example: Example) -> None:
    name, _, _ = example.parsed.removeprefix("# ").partition("\n")
    assert name.endswith(".toml"), f"expected the name of a file in the first line, found {name!r}"
    Path(name).write_text(example.parsed)


def strangers(document: Document) -> Iterator[Region]:
    """Blocks that no parser takes."""
    for block in re.finditer(r"^[ \t]*(`{3,}|~{3,})([^\n]*)\n.*?^[ \t]*\1", document.text, re.DOTALL | re.MULTILINE):
        if block[2] not in LANGUAGES:
            yield Region(block.start(), block.end(), block[2], refuse)


def refuse(example: Example) -> None:
    raise AssertionError(f"expected a block of {', '.join(LANGUAGES)}, found {example.parsed!r}")


def enter(namespace: dict) -> None:
    namespace["folder"] = tempfile.TemporaryDirectory()
    namespace["torch_is_here"] = importlib.util.find_spec("torch") is not None
    # Pages show scripts.
    namespace["__name__"] = "__main__"
    namespace["before"] = os.getcwd()
    os.chdir(namespace["folder"].name)


def leave(namespace: dict) -> None:
    os.chdir(namespace["before"])
    namespace["folder"].cleanup()


pytest_collect_file = Sybil(
    parsers=[
        SkipParser(),
        PythonCodeBlockParser(doctest_optionflags=DIFFERENCES),
        CodeBlockParser("sh", sh),
        CodeBlockParser("text", text),
        CodeBlockParser("toml", toml),
        strangers,
    ],
    pattern="*.md",
    setup=enter,
    teardown=leave,
).pytest()
