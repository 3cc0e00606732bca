"""The page of `edgepuck view`."""

from __future__ import annotations

import html
import os
import tempfile
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from . import _edgepuck


class View:
    """A page of `edgepuck view`, which a notebook shows."""

    def __init__(self, page: str) -> None:
        self.page = page
        """The page: HTML with all that it needs."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page. An existing file is replaced."""
        Path(path).write_text(self.page, encoding="utf-8")

    def open(self) -> str:
        """Open the page in the browser, and return the path of its file."""
        handle, path = tempfile.mkstemp(prefix="edgepuck-view-", suffix=".html")
        os.close(handle)
        self.save(path)
        webbrowser.open(Path(path).as_uri())
        return path

    def __repr__(self) -> str:
        return f"<View of {len(self.page)} bytes>"

    def _repr_html_(self) -> str:
        page = html.escape(self.page)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 480px; border: 0"></iframe>'


def page_of(words: Sequence[str]) -> View:
    """The page that `edgepuck view` writes if it is called with `words`."""
    with tempfile.TemporaryDirectory(prefix="edgepuck-") as folder:
        page = Path(folder, "page.html")
        _edgepuck.run(["edgepuck", "view", *words, "--out", os.fspath(page)])
        return View(page.read_text(encoding="utf-8"))
