"""The faults of a scene file, as messages tell them."""

import pytest

from mpp_taichi import SceneError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble


def told(scene):
    """The faults of `scene.yaml`, each without the folder of the file."""
    with pytest.raises(SceneError) as caught:
        assemble(load_scene(scene))
    return [line.split("scene.yaml:")[-1] for line in caught.value.faults]
