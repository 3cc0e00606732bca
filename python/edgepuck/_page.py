"""The page of `edgepuck view`."""

from __future__ import annotations

import base64
import contextlib
import gzip
import html
import os
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Iterator, Sequence
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
        packed = base64.b64encode(gzip.compress(self.page.encode(), mtime=0)).decode()
        page = html.escape(_UNPACK.replace("PACKED", packed))
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 480px; border: 0"></iframe>'


# A page that opens the packed one, a quarter of its size: notebooks keep what their cells show.
_UNPACK = """<!doctype html>
<meta charset="utf-8">
<script>
const bytes = Uint8Array.from(atob("PACKED"), (char) => char.charCodeAt(0));
const unpacked = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
new Response(unpacked).text().then((page) => { document.open(); document.write(page); document.close(); });
</script>
"""


def page_of(words: Sequence[str], folder: str) -> View:
    """The page that `edgepuck view` writes if it is called with `words`, by way of a temporary `folder`."""
    page = Path(folder, "page.html")
    with _HELD, _without_path(page, folder):
        _arguments.run(["view", *words, "--out", os.fspath(page)], folder)
    return View(page.read_text(encoding="utf-8"))


# The standard error is that of the whole process.
_HELD = threading.Lock()


@contextlib.contextmanager
def _without_path(page: Path, folder: str) -> Iterator[None]:
    """Leave out of what is written to the standard error the line that names the temporary page."""
    try:
        before = os.dup(2)
    except OSError:
        # There is none.
        yield
        return
    with tempfile.TemporaryFile() as said:
        try:
            os.dup2(said.fileno(), 2)
            yield
        finally:
            os.dup2(before, 2)
            os.close(before)
            said.seek(0)
            lines = said.read().decode("utf-8", "replace").splitlines(keepends=True)
            rest = "".join(line for line in lines if os.fspath(page) not in line)
            if rest and sys.stderr:
                sys.stderr.write(rest.replace(os.path.join(folder, ""), ""))
