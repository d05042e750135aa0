"""The model of `sliders:`, the keys of an entry; sliders.py finds the parameters that an entry acts on."""

from typing import Annotated, Any

from pydantic import BaseModel, create_model
from pydantic import Field as Describe

from mpp_taichi.scene.fields import ListOf, Number, Text
from mpp_taichi.scene.parameters import STRICT

LETTERS = "abcdefgijkmnoprtuvwxyz"
"""Letters that may steer; help, log, state and quit (h, l, s, q) keep their keys in every window."""


def _key(check: Any, default: Any, description: str) -> Any:
    return (Annotated[Any, check], Describe(default, description=description))


def slider_model() -> type[BaseModel]:
    """The model of one entry of `sliders:`; `from` is no name that Python allows for an attribute of a class."""
    keys: dict[str, Any] = {
        "set": _key(Text(), ..., "the parameter, written as in --set: forces.newtonian_gravity.strength"),
        "from": _key(Number(), None, "the lower end; absent: 0, or a tenth of the scene's value where 0 is not allowed"),
        "to": _key(Number(), None, "the upper end; absent: twice the scene's value, on a logarithmic scale ten times"),
        "scale": _key(Text(("linear", "log")), "linear", "scale of the slider: linear or log"),
        "keys": _key(
            ListOf(Text(tuple(LETTERS)), (2,), "letters"),
            None,
            "two letters, [b, m]: keys of the window; while the first is held, the parameter is at the lower end, while the "
            "second is held, at the upper end, and otherwise where it was at the start",
        ),
        "label": _key(Text(), "", "text beside the slider; absent: the parameter"),
    }
    return create_model("Slider", __config__=STRICT, __doc__="A parameter that is moved while the scene runs.", **keys)
