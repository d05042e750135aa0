"""The gallery: every scene of the program with its picture, its source and, where it was recorded, its playing page."""

from pathlib import Path

from mpp_taichi.scene.catalogue import Listed, listed

FOLDER = "gallery"


def gallery_pages(root: Path, recorded: Path) -> dict[str, str | bytes]:
    """Path and content of every page, and of the playing pages in the folder `recorded`."""
    scenes = listed(sorted((root / "scenes").rglob("*.yaml")))
    pages: dict[str, str | bytes] = {f"{FOLDER}/README.md": _overview(scenes, root)}
    for scene in scenes:
        playing = recorded / f"{scene.name}.html"
        pages[f"{FOLDER}/{scene.name}.md"] = _page(scene, root, plays=playing.is_file())
        if playing.is_file():
            pages[f"{FOLDER}/play/{scene.name}.html"] = playing.read_bytes()
    return pages


def _picture(scene: Listed, root: Path) -> str:
    for name in (f"{scene.name}.png", f"gallery/{scene.name}.webp"):
        if (root / "docs" / "pictures" / name).is_file():
            return f"![{scene.title}](../pictures/{name})"
    return ""


def _overview(scenes: list[Listed], root: Path) -> str:
    lines = [
        "# Gallery",
        "",
        "Every scene that comes with the program, with its source. `mpp-taichi NAME` runs a scene by its name.",
    ]
    for topic in dict.fromkeys(scene.topic for scene in scenes):
        lines += ["", f"## {topic}", "", '<div class="gallery" markdown>', ""]
        for scene in (scene for scene in scenes if scene.topic == topic):
            picture = _picture(scene, root)
            lines += [f"[{picture}<br>{scene.title}]({scene.name}.md)" if picture else f"[{scene.title}]({scene.name}.md)", ""]
        lines += ["</div>"]
    return "\n".join(lines) + "\n"


def _page(scene: Listed, root: Path, *, plays: bool) -> str:
    lines = [f"# {scene.title}", "", scene.description, "", _picture(scene, root), ""]
    if plays:
        lines += [f'<iframe class="playing" src="play/{scene.name}.html" title="{scene.title}" loading="lazy"></iframe>', ""]
    lines += ["```sh", f"mpp-taichi {scene.name}", f"mpp-taichi new my.yaml --like {scene.name}", "```", ""]
    lines += [
        f"The scene, `{scene.file.relative_to(root)}`:",
        "",
        "```yaml",
        scene.file.read_text(encoding="utf-8").rstrip(),
        "```",
    ]
    return "\n".join(lines) + "\n"
