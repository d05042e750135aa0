"""The walls of a scene that move or rub, as `explain` tells them."""

from collections import Counter

from mpp_taichi.scene.spec import ComponentSpec, SceneSpec


def walls_told(spec: SceneSpec) -> list[str]:
    """`8 segment: turning by 2*t`, for all walls of a kind that move alike; empty where all walls are smooth and at rest."""
    told = Counter(text for wall in spec.walls if (text := _told(wall)))
    return [f"{count} {text}" for text, count in told.items()]


def _told(wall: ComponentSpec) -> str:
    given = wall.parameters
    parts = [f"velocity [{', '.join(f'{each:g}' for each in given['velocity'])}]"] if any(given.get("velocity", ())) else []
    parts += [f"motion [{', '.join(given['motion'])}]"] if given.get("motion") else []
    parts += [f"turning by {given['turning'].angle}"] if given.get("turning") else []
    parts += [f"friction {given['friction']:g}"] if given.get("friction") else []
    return f"{wall.name}: {', '.join(parts)}" if parts else ""
