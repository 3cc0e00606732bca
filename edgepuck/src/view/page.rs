//! The page: the viewer and its data in one file, which needs nothing else.

use super::frame::Pane;
use anyhow::Context;
use formats::atomic;
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// What the viewer takes.
#[derive(Serialize)]
struct Data<'a> {
    panes: &'a [Pane],
}

/// Writes the page of `panes`, atomically.
pub fn write(panes: &[Pane], out: &Path) -> anyhow::Result<()> {
    let data = serde_json::to_string(&Data { panes }).context("writing JSON")?;
    // No name in it can end its element.
    let data = data.replace('<', "\\u003c");
    let viewer = edgepuck_assets::VIEWER;
    atomic::write(out, |page| {
        write!(
            page,
            r#"<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Edgepuck</title>
<style>html, body, #view {{ height: 100%; margin: 0; background: #12161d }}</style>
<div id="view"></div>
<script type="application/json" id="data">{data}</script>
<script>{viewer}</script>
<script>var viewer = EdgepuckViewer.show("view", "data");</script>
</html>
"#
        )
    })?;
    Ok(())
}
