"""Write: a scene as a mapping → the text of a scene file, a line to a particle."""

from collections.abc import Iterator, Mapping
from typing import Any

import yaml


def scene_text(scene: Mapping[str, Any], comment: str = "") -> str:
    """YAML that reads back as the same mapping; numbers keep all their digits."""
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    for key, value in scene.items():
        lines += _entry(key, value)
    return "\n".join(lines) + "\n"


def _entry(key: str, value: Any) -> Iterator[str]:
    if isinstance(value, list) and value and all(isinstance(item, dict) and len(item) == 1 for item in value):
        yield f"{key}:"
        for item in value:
            ((name, content),) = item.items()
            yield f"  - {name}: {_flow(content)}"
    else:
        yield f"{key}: {_flow(value)}"


def _flow(value: Any) -> str:
    text: str = yaml.dump(_plain(value), Dumper=_Dumper, default_flow_style=True, sort_keys=False, width=float("inf"))
    return text.removesuffix("...\n").strip()


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value


class _Dumper(yaml.SafeDumper):
    """Writes no anchors such as `&id001`: a value that occurs twice is written twice."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _number(dumper: yaml.SafeDumper, value: float) -> yaml.ScalarNode:
    """The shortest text of this number; with a point, so that YAML reads 1e-05 as a number."""
    text = repr(value)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return dumper.represent_scalar("tag:yaml.org,2002:float", text)


_Dumper.add_representer(float, _number)
