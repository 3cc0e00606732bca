"""`cargo xtask report` in headless Chromium: nothing on the console, no request,
clouds drawn and turned, tabs and tips at work, on a desktop and on a phone."""

import os
import shutil

from peer import OUT, run, skip, skipped_if_missing

with skipped_if_missing():
    from playwright.sync_api import sync_playwright

PROGRAMS = ["chromium", "chromium-browser", "google-chrome", "chrome"]
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
DESKTOP = {"width": 1200, "height": 900}
PHONE = {"width": 390, "height": 844}

def main():
    browser_path = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if browser_path is None:
        skip("no Chromium on the PATH")
    page_file = OUT / "report.html"
    run(os.environ["EDGEPUCK_LAB"], "report", "--out", page_file)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=FLAGS)
        for size in (DESKTOP, PHONE):
            look(browser, page_file.resolve().as_uri(), size)
        browser.close()
    print("the page works, wide and narrow")


def look(browser, address, size):
    page = browser.new_page(viewport=size)
    complaints, requests = [], []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    check_clouds(page)
    tips = 0
    for tab in page.query_selector_all("[role=tab]"):
        tab.click()
        chapter = page.query_selector("#" + tab.get_attribute("data-tab"))
        assert chapter.is_visible(), tab.inner_text()
        shown = [s for s in page.query_selector_all("[role=tabpanel]") if s.is_visible()]
        assert len(shown) == 1, "one chapter at a time"
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= size["width"], f"{tab.inner_text()}: {wide} px wide"
        tips += check_tip(page, chapter)
    assert tips > 0, "no chapter has a drawing with tips"
    assert complaints == [], complaints
    assert [r for r in requests if not r.startswith("file:")] == [], requests
    page.close()


def check_clouds(page):
    canvases = page.query_selector_all("canvas.cloud")
    assert canvases, "no cloud to turn"
    canvas = next(c for c in canvases if c.is_visible())
    canvas.scroll_into_view_if_needed()
    before = picture(canvas)
    assert len(before) > 2 * len(blank(canvas)), "the cloud is drawn"
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 80, box["y"] + box["height"] / 2 + 20)
    page.mouse.up()
    assert picture(canvas) != before, "dragging turns it"


def picture(canvas):
    return canvas.evaluate("canvas => canvas.toDataURL()")


def blank(canvas):
    return canvas.evaluate(
        """canvas => {
          const { width, height } = canvas;
          return Object.assign(document.createElement("canvas"), { width, height }).toDataURL();
        }"""
    )


def check_tip(page, chapter):
    dot = chapter.query_selector("[data-tip]")
    if dot is None:
        return 0
    dot.scroll_into_view_if_needed()
    box = dot.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    tip = page.query_selector("#tip")
    assert tip.is_visible() and tip.inner_text().strip(), "a dot says what it is"
    return 1


main()
