"""A random sample of mutants, drawn by a seed: a module by its length, a line of it, an operator, and one of its mutants."""

import random
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

from mutation.cosmic_ray_operators import cosmic_ray_places
from mutation.own_operators import own_mutants
from mutation.source import Mutant, Source

TRIES = 60  # so often in a row a module may give no new mutant


def candidates(source: Source, *, library: bool = True) -> dict[int, dict[str, list[Callable[[], Mutant | None]]]]:
    """By line and operator: what makes the mutants of a module."""
    found: dict = defaultdict(lambda: defaultdict(list))
    for mutant in own_mutants(source):
        found[mutant.line][mutant.operator].append(lambda mutant=mutant: mutant)
    for place in cosmic_ray_places(source) if library else ():
        found[place.line][place.operator].append(lambda place=place: place.mutant(source))
    return found


def compiles(text: str) -> bool:
    """Whether Python takes the text for a module."""
    try:
        compile(text, "mutant", "exec")
    except SyntaxError:
        return False
    return True


def draw(root: Path, paths: list[Path], count: int, seed: int, *, library: bool = True) -> list[Mutant]:
    """So many different mutants of the modules `paths` below `root`; fewer where there are not so many."""
    chance = random.Random(seed)
    sources = {path: Source(root, path) for path in paths}
    weights = [len(source.lines) for source in sources.values()]
    known: dict[Path, dict] = {}
    found: dict[tuple, Mutant] = {}
    failures = 0
    while len(found) < count and failures < TRIES:
        path = chance.choices(paths, weights)[0]
        source = sources[path]
        if path not in known:
            known[path] = candidates(source, library=library)
        failures += 1
        if known[path]:
            by_operator = known[path][chance.choice(sorted(known[path]))]
            mutant = chance.choice(by_operator[chance.choice(sorted(by_operator))])()
            if mutant is not None and _key(mutant) not in found and compiles(mutant.apply(source.text)):
                found[_key(mutant)] = mutant
                failures = 0
    return list(found.values())


def _key(mutant: Mutant) -> tuple:
    return mutant.path, mutant.start, mutant.end, mutant.replacement
