"""Which integrators the rows about methods ask."""

from mpp_taichi import component


def with_steps() -> list[str]:
    """The integrators that take steps of dt and follow a motion by its force, without a bath of heat."""
    others = ("event_driven", "wisdom_holman")  # exact flights and exact orbits
    every = [
        name
        for name in component.names("integrators")
        if name not in others and not component.flag("integrators", name, "draws_random")
    ]
    return [name for name in every if component.declaration("integrators", name).base not in ("Adaptive", "Embedded")]
