"""Guides of the scene reference: repeats and units, whose meaning is more than the keys of a table."""

from collections.abc import Iterator

from mpp_taichi.scene import repeat_words, units

REPEATS = """
### `repeat:`, an entry of `particles:`, `springs:` and `walls:`

An entry `repeat: {count: 12, as: i, body: {…}}` stands for twelve bodies, with i = 0 … 11. It holds one component of its
list, several of them under `entries:`, or another repeat. In a number, an expression may use the variable:
`mass: 1 + 0.1 * i`. In a name the variable stands in braces, and the name in quotes: `"ball_{i}"`, `"ball_{i + 1}"`; constants
may stand there too. A reference may also be an index: `between: [i, i + 1]`. The entries are written out before anything else
is checked, and a message gives the line of the repeat with the value of the variable.

```yaml
dimensions: 2
constants: {links: 8, gap: 0.2}
particles:
  - body: {name: bead_0, mass: 0.1, position: [0, 0], free: false}
  - repeat:
      count: links
      as: i
      body: {name: "bead_{i + 1}", mass: 0.1, position: [gap * (i + 1), 0], radius: 0.04}
springs:
  - repeat: {count: links, as: i, link: {between: ["bead_{i}", "bead_{i + 1}"], stiffness: 500 / (1 + i)}}
forces:
  - uniform_gravity: {acceleration: [0, -9.81]}
integrator: {leapfrog: {dt: 1e-3}}
run: {duration: 1}
```

`mpp-taichi pendulum_wave --set "particles[1].repeat.body.radius=0.02"` changes the text of a repeat: a path through `repeat`
counts the entries as they are written. Every other path, also in `timeline:` and `sliders:`, counts them after the repeats are
written out: `particles[13].body.radius` is the second of these balls.

| key | default | meaning |
|---|---|---|"""

UNITS = """
### `units:`

Three words, a length, a time and a mass, are the units of every number in the scene:
`units: {length: AU, time: day, mass: Msun}`. Speeds are then in AU/day, accelerations in AU/day², energies in Msun AU²/day²,
and the stiffness of springs in Msun/day². Nothing is converted, in the scene or in the files that the program writes: times and
lengths in tables, films, trajectories, states and pages, and the bounds of `expect:`, are in the units of the scene. Angles are
in radians, but `field_of_view` and `angular_radius` of the view in degrees, and `record.seconds` counts seconds of the film.

With units the number `G` is known: `newtonian_gravity` without a `strength` takes it, and expressions may use it. It is
computed from G·M of the unit of mass, because astronomy knows this product better than G itself: with AU, day and Msun, G is
Gauss's k² = 0.01720209895² to nine digits. Without `units:` the numbers have no dimension, `newtonian_gravity` has the
strength 1, and `G` is unknown.

```yaml
# A geostationary satellite: one revolution in a sidereal day of 86,164 s.
units: {length: km, time: s, mass: Mearth}
particles:
  - body: {name: earth, mass: 1, position: [0, 0, 0]}
  - body: {name: satellite, mass: 0, around: earth, semi_major_axis: 42164.17}
forces: [newtonian_gravity]
integrator: {leapfrog: {dt: 60}}
run: {duration: 90000}
expect:
  orbital_period: {of: satellite, around: earth, near: 86164, within: 1e-4}
```

| key | words |
|---|---|"""


def repeats() -> Iterator[str]:
    """The guide to repeats, with the table of their keys."""
    yield REPEATS
    defaults = {repeat_words.COUNT: "**required**", repeat_words.VARIABLE: f"`{repeat_words.VARIABLE_WHEN_ABSENT}`"}
    for key, meaning in repeat_words.DESCRIPTIONS.items():
        yield f"| `{key}` | {defaults.get(key, '')} | {meaning} |"


def unit_words() -> Iterator[str]:
    """The guide to units, with the words that each key takes."""
    yield UNITS
    known = {"length": units.LENGTHS, "time": units.TIMES, "mass": units.GRAVITATIONAL_PARAMETERS}
    for key, words in known.items():
        yield f"| `{key}` | {', '.join(f'`{word}`' for word in words)} |"
    yield "\n`yr` is the Julian year of 365.25 days, `t` a tonne, `Rearth` and `Rsun` the nominal radii of the IAU."
