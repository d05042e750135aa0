"""The orbit of a particle, or of the centre of mass of a group, around another, as several quantities measure it."""

from mpp_taichi.arithmetic.orbital_elements import Orbit, orbit_of
from mpp_taichi.component import Particles
from mpp_taichi.quantities._base import NoResultError, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import center_of, rows


def require_orbit(of: Particles, around: Particles, setting: Setting) -> None:
    """NoResultError where the scene has no gravity, or the two groups have a particle in common."""
    scenes = (setting.spec, *(event.scene for event in setting.spec.timeline))
    if not any(scene.forces_with("gravitates") for scene in scenes):
        raise NoResultError("an orbit needs gravity, and the scene has no such force")
    if of[0] < around[0] + around[1] and around[0] < of[0] + of[1]:
        raise NoResultError("a body has no orbit around itself: of: and around: have a particle in common")


def orbit(sample: RunSample, of: Particles, around: Particles) -> Orbit:
    """The osculating orbit of two centres of mass, with G and the masses of both groups.

    Raises:
        NoResultError: no mass attracts, a group has merged into other bodies, or the two move along one line.
    """
    snapshot = sample.snapshot
    separation, motion = (
        center_of(values, snapshot, of) - center_of(values, snapshot, around)
        for values in (snapshot.position, snapshot.velocity)
    )
    mass = snapshot.mass[rows(of)].sum() + snapshot.mass[rows(around)].sum()
    attraction = float(sample.gravity * mass)
    if not attraction > 0.0:
        raise NoResultError("an orbit needs gravity, and a mass that attracts")
    try:
        return orbit_of(separation, motion, attraction)
    except ValueError as error:
        raise NoResultError(str(error)) from None


def orbit_label(noun: str, of: Particles, around: Particles, setting: Setting) -> str:
    """`eccentricity of planet around sun`."""
    return f"{of_which(noun, setting.name_of(of))} around {setting.name_of(around)}"
