"""Reads a page of `record --html`, from the description of its format alone."""

import base64
import json
import re
import zlib
from pathlib import Path

import numpy as np


def read_page(path):
    """The header of a page, its columns by name as (frames, entries), and their steps; springs as [(first, between, color)]."""
    text = Path(path).read_text(encoding="utf-8")
    header = json.loads(re.search(r'<script type="application/json" id="header">(.*?)</script>', text, re.DOTALL)[1])
    block = zlib.decompress(base64.b64decode(re.search(r'id="block">(.*?)</script>', text, re.DOTALL)[1]))
    place = 0

    def take(kind, count):
        nonlocal place
        found = np.frombuffer(block, kind, count, place)
        place += found.nbytes
        return found

    def column(description, frames):
        entries, size = description["entries"], description["bytes"]
        origin, step = take("<f8", entries), take("<f8", entries)
        if size == 0:
            return np.tile(origin, (frames, 1)), step
        code = sum(take("u1", frames * entries).astype(np.int64) << (8 * plane) for plane in range(size))
        code = np.where(code % 2, -(code + 1) // 2, code // 2).reshape(frames, entries)
        for _ in range(description["order"]):
            code = np.cumsum(code, axis=0)
        code %= 2 ** (8 * size)
        return np.where(code == 2 ** (8 * size) - 1, np.nan, origin + step * code), step

    frames = len(header["times"])
    columns, steps = {}, {}
    for description in header["columns"]:
        columns[description["name"]], steps[description["name"]] = column(description, frames)
    if path := header["path"]:
        rows = (frames - 1) * path["pieces"] + 1
        for description in path["columns"]:
            columns[description["name"]], steps[description["name"]] = column(description, rows)
    links = [take("<i4", 2 * each["count"]).reshape(-1, 2) for each in header["springs"]]
    colors = [column(each["color"], each["frames"])[0] for each in header["springs"]]
    assert place == len(block)
    springs = [(each["first"], *found) for each, *found in zip(header["springs"], links, colors, strict=True)]
    return header, columns, steps, springs
