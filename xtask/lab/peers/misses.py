"""Every object that `detect` misses in labelled sweeps and every false alarm as a picture, on one page, sorted by kind.

    python xtask/lab/peers/misses.py FRAME.npz... --out misses.html [--min-confidence 0.5]

It needs the package edgepuck, NumPy and Pillow; frames and rules are those of by_class.py, which stands beside it. A picture
shows 8 m from above and, to its right, from the side as the sensor looks across: the object's points are red, ground is pale.
"""

import argparse
import base64
import io
from collections import defaultdict
from html import escape
from pathlib import Path

import by_class
import edgepuck as ep
import numpy as np
from PIL import Image

REACH_M, SIDE, HIGHEST_M = 4.0, 160, 4.0
GROUND, STANDING, OWN = (225, 225, 225), (90, 90, 90), (220, 0, 0)


def picture(points, is_ground, own):
    """A PNG of the points about those of `own`."""
    middle = (points[own].min(0) + points[own].max(0)) / 2
    sight = np.arctan2(middle[1], middle[0])
    off = points - middle
    ahead = off[:, 0] * np.cos(sight) + off[:, 1] * np.sin(sight)
    aside = off[:, 1] * np.cos(sight) - off[:, 0] * np.sin(sight)
    over = points[:, 2] - points[own, 2].min()
    is_own = np.zeros(len(points), bool)
    is_own[own] = True
    pixels = np.full((SIDE, 2 * SIDE + 4, 3), 255, np.uint8)
    near = (np.abs(ahead) < REACH_M) & (np.abs(aside) < REACH_M)
    for which, colour in [(is_ground, GROUND), (~is_ground & ~is_own, STANDING), (is_own, OWN)]:
        which = which & near
        column = ((REACH_M - aside[which]) / (2 * REACH_M) * SIDE).astype(int)
        pixels[((REACH_M - ahead[which]) / (2 * REACH_M) * SIDE).astype(int), column] = colour
        row = (0.8 - over[which] / (2 * REACH_M)) * SIDE
        seen = (row >= 0) & (row < SIDE)
        pixels[row[seen].astype(int), column[seen] + SIDE + 4] = colour
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return base64.b64encode(file.getvalue()).decode()


def cases(file, least):
    """(kind, figure in HTML) of each miss and false alarm of a sweep."""
    sweep = by_class.read(file)
    points, rings = sweep[0], sweep[1]
    is_ground = ep.segment(points.astype(np.float32), rings=rings) == -1
    for one in by_class.outcomes(sweep, least):
        if one.kind in ("missed", "false"):
            away = np.hypot(*points[one.points, :2].mean(0))
            told = f"{file.stem}: {away:.0f} m, {len(one.points)} points"
            if one.kind == "false":
                told += f", {one.confidence:.2f}: {one.truth}"
            shown = f'<img src="data:image/png;base64,{picture(points, is_ground, one.points)}">'
            yield f"{one.kind} {one.label}", f"<figure>{shown}<figcaption>{escape(told)}</figcaption></figure>"


def main():
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("frames", type=Path, nargs="+")
    flags.add_argument("--min-confidence", type=float, default=0.5)
    flags.add_argument("--out", type=Path, required=True)
    asked = flags.parse_args()
    by_kind = defaultdict(list)
    for file in asked.frames:
        for kind, figure in cases(file, asked.min_confidence):
            by_kind[kind].append(figure)
    page = ["<!doctype html><meta charset=utf-8><title>Misses and false alarms</title>",
            "<style>body{font:12px sans-serif} figure{display:inline-block;margin:4px;width:326px}</style>"]
    for kind, figures in sorted(by_kind.items()):
        page += [f"<h2>{escape(kind)}: {len(figures)}</h2>", *figures]
        print(f"{kind}: {len(figures)}")
    asked.out.write_text("\n".join(page) + "\n")


if __name__ == "__main__":
    main()
