"""The page of `edgepuck view`."""

from __future__ import annotations

import html
import os
import tempfile
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from . import _arguments, _edgepuck


class View:
    """A page of `edgepuck view`, which a notebook shows."""

    def __init__(self, page: str) -> None:
        self.page = page
        """The page: HTML with all that it needs."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file with the extension .html. An existing file is replaced, and a missing folder is made.

        Raises:
            Error: The name has another extension, or the file cannot be written.
        """
        _arguments.check_extension(path, ".html")
        page = Path(path)
        part = page.with_name(f".{page.name}.tmp")
        try:
            page.parent.mkdir(parents=True, exist_ok=True)
            try:
                part.write_text(self.page, encoding="utf-8")
                part.replace(page)
            finally:
                part.unlink(missing_ok=True)
        except OSError as error:
            raise _edgepuck.Error(f"{os.fspath(path)}: {error.strerror}") from None

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


def page_of(words: Sequence[str], folder: str) -> View:
    """The page that `edgepuck view` writes if it is called with `words`, by way of a temporary `folder`."""
    page = Path(folder, "page.html")
    _arguments.run(["view", *words, "--out", os.fspath(page)], folder)
    return View(page.read_text(encoding="utf-8"))
