"""Fonts of matplotlib for titles with any letters: its own font first, then fonts of the machine that have the others."""

from mpp_taichi.plots.lettering import runs


def families(text: str) -> list[str]:
    """Names of families for a text; matplotlib takes each letter from the first of them that has it.

    Fonts of bitmaps are left out, since matplotlib draws outlines only.
    """
    from matplotlib import font_manager, rcParams

    found = [*rcParams["font.family"]]
    for run in runs(text):
        if run.file is not None and not run.file.strike:
            font_manager.fontManager.addfont(run.file.path)
            name = font_manager.FontProperties(fname=run.file.path).get_name()
            found += [name] if name not in found else []
    return found
