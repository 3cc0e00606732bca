"""Builds the site, with the page that scans in a browser if it is built, and follows every link within it."""

import os
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[1]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
# Where web/test.sh, a step of `cargo xtask test` before this one, builds the page.
PAGE = TARGET / "page-test/page"


class Links(HTMLParser):
    """The addresses that a page names, and its anchors."""

    def __init__(self, text):
        super().__init__()
        self.named, self.anchors = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("href", "src") and value:
                self.named.append(value)
            elif name in ("id", "name"):
                self.anchors.add(value)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    if shutil.which("mdbook") is None:
        pytest.skip("mdBook is not installed")
    if not PAGE.is_dir():
        pytest.skip(f"the page is not built: {PAGE} is missing")
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(["sh", ROOT / "docs/build.sh", out], env={**os.environ, "EDGEPUCK_PAGE": str(PAGE)},
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_the_site_has_the_page_and_the_notebooks(site):
    assert "edgepuck_web" in (site / "page/worker.js").read_text() and (site / "page/edgepuck_web_bg.wasm").exists()
    assert len(list(site.glob("notebooks/*.ipynb"))) == 3


def test_every_link_leads_somewhere(site):
    pages = {file: Links(file.read_text()) for file in site.rglob("*.html") if file.name not in ("404.html", "toc.html")}
    dead = []
    for file, links in pages.items():
        for link in links.named:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            to = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            if not to.exists():
                dead.append(f"{file.relative_to(site)}: {link}")
            elif parts.fragment and to in pages and unquote(parts.fragment) not in pages[to].anchors:
                dead.append(f"{file.relative_to(site)}: {link}, which has no such section")
    assert not dead, "\n".join(dead)
