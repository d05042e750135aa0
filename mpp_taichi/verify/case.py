"""Case: one question with a known answer, which is asked of a backend in a precision."""

from collections.abc import Callable
from dataclasses import dataclass

from mpp_taichi.precision import PRECISIONS
from mpp_taichi.verify.place import Place

GROUPS = {
    "forces": "Forces against an independent sum",
    "formulas": "Forces that are formulas, and fields",
    "gravity": "Hard cases of gravity",
    "springs": "Hard cases of springs",
    "networks": "Hard cases of networks of springs",
    "spheres": "Hard cases of spheres",
    "heaps": "Hard cases of heaps",
    "numerics": "Reproducible numbers",
    "orders": "Orders, reversibility and conservation of integrators",
    "stability_limits": "The longest stable step of integrators",
    "published_gravity": "Published numbers: choreographies and periodic orbits",
    "published_encounters": "Published numbers: encounters and scattering",
    "published_solar_system": "Published numbers: the Solar System",
    "published_runs": "Published numbers: runs of a course, and Kepler-16",
    "published": "Published numbers: springs, pendulums and rockets",
    "published_spheres": "Published numbers: balls",
    "refusals": "What must be refused",
    "other_codes": "Beside other codes",
    "statistics": "Statistics of gases",
}
"""The modules of `cases/` in the order of the report, with their headings."""


@dataclass(frozen=True)
class Found:
    """The answer to a question: solved where `reached` ≤ `bound`.

    reached   the number that the run gave, most often an error, without a sign
    bound     the largest number that is right
    because   the origin of the bound: the formula, with the numbers that were put into it
    """

    reached: float
    bound: float
    because: str


@dataclass(frozen=True)
class Case:
    """A question.

    name       by which `--only` chooses it
    title      the question in one sentence
    source     of the answer: closed form, book, paper or other code
    ask        a function of a place that runs the scene; errors of the program (MppError) are refusals
    quick      whether the short examination asks it
    solved_in  precisions in which the CPU has to solve it: a refusal there is a failure
    on         precisions in which it is asked
    """

    name: str
    group: str
    title: str
    source: str
    ask: Callable[[Place], Found]
    quick: bool
    solved_in: tuple[str, ...]
    on: tuple[str, ...] = PRECISIONS


def case(
    title: str,
    source: str,
    *,
    quick: bool = False,
    solved_in: tuple[str, ...] = ("f64",),
    on: tuple[str, ...] = PRECISIONS,
) -> Callable[[Callable[[Place], Found]], Case]:
    """Make a case of a function of a place; its name and its group are those of the function and of its module."""

    def made(ask: Callable[[Place], Found]) -> Case:
        return Case(ask.__name__, ask.__module__.rpartition(".")[2], title, source, ask, quick, solved_in, on)

    return made
