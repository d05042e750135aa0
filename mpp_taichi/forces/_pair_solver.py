"""The choice of the solver that sums the pair forces of a scene: the only place that knows which solvers there are.

A solver is a class of `neighbors/` with these members:

    accumulate_serial(state, first)     adds the accelerations inside a serial loop; a tree has none
    accumulate_parallel_gather(state)   adds them at the top of a kernel, for GPUs; a tree has none
    add_accelerations(state)            adds them in launches of its own
    sets_directly, set_serial           whether, and how, a serial sum overwrites the accelerations
    in_tiles                            whether a serial sum streams over the vectors of all particles
    is_symmetric(state)                 whether a launched sum evaluates each pair once, and `set_accelerations` may overwrite
    loops(state)                        parallel loops of one launched sum on the cores of a CPU
    longest_loop                        most iterations that a thread makes for one particle
    all_pairs                           the AllPairs that a direct sum is built on; a tree has none
    potential_terms(state)              energies of all particles, of a solver that sums them in launches of its own
    work_fields(), memory, begin(state)   fields of the state, those of them that are saved, and their start; of lists
    destroy()                           frees the memory of the sums

A new solver, such as a fast multipole method, is a file in `neighbors/`, a row in `SOLVERS` and a choice of `solver` in the
force; a sum over fewer pairs, which the program chooses (_fewer_pairs.py), has its row in `FEWER`. Loop shapes of the direct
sum (serial, symmetric, lanes, gather) are chosen by `AllPairs` itself.
"""

from collections.abc import Callable, Sequence
from typing import Any

from mpp_taichi.forces._base import PairForce
from mpp_taichi.forces._fewer_pairs import Between, Lists


def pair_solver(
    pairs: Sequence[PairForce],
    particle_count: int,
    dimensions: int,
    *,
    merges: bool,
    derivatives: int,
    two_parts: bool = False,
    fewer: Lists | Between | None = None,
) -> tuple[str, Any]:
    """Name and solver of the sum of these forces, of which there is at least one.

    `fewer` says by which sum over fewer than all pairs (_fewer_pairs.py). Raises TypeError where one force asks for a solver
    that cannot sum all of them.
    """
    if fewer is not None:
        return fewer.solver, FEWER[fewer.solver](pairs, particle_count, dimensions, fewer)
    named = [force.solver for force in pairs if force.solver != "direct"]
    name = named[0] if named else "direct"
    solver = SOLVERS[name](pairs, particle_count, dimensions, merges, derivatives)
    if two_parts:
        from mpp_taichi.neighbors.two_part_pairs import TwoPartPairs

        solver = TwoPartPairs(solver)
    return name, solver


# The imports are local, so that a scene loads only the solver that it asks for.


def _direct(pairs: Sequence[PairForce], particle_count: int, dimensions: int, merges: bool, derivatives: int) -> Any:
    from mpp_taichi.neighbors.all_pairs import AllPairs

    direct = AllPairs(pairs, particle_count, dimensions, merges=merges)
    if not derivatives:
        return direct
    from mpp_taichi.neighbors.pair_derivatives import PairDerivatives

    return PairDerivatives(direct, derivatives)


def _tree(pairs: Sequence[PairForce], particle_count: int, dimensions: int, merges: bool, derivatives: int) -> Any:
    from mpp_taichi.neighbors.tree import TreeSum

    if len(pairs) > 1 or derivatives or merges:
        raise TypeError("a tree sums only gravity, without derivatives, over bodies that do not merge")
    return TreeSum(pairs[0], particle_count, dimensions)


def _lists(pairs: Sequence[PairForce], particle_count: int, dimensions: int, fewer: Any) -> Any:
    from mpp_taichi.neighbors.cutoff_sum import CutoffSum

    return CutoffSum(pairs, particle_count, dimensions, reach=fewer.reach, box=fewer.box)


def _between(pairs: Sequence[PairForce], particle_count: int, dimensions: int, fewer: Any) -> Any:
    from mpp_taichi.neighbors.pairs_between import PairsBetween

    return PairsBetween(fewer.forces, particle_count, dimensions)


SOLVERS: dict[str, Callable[..., Any]] = {"direct": _direct, "tree": _tree}
FEWER: dict[str, Callable[..., Any]] = {"lists": _lists, "between": _between}
