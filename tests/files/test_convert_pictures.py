"""Pictures, tilts and periods of a SolarSystem.xml in the scene that `convert` writes."""

import math

import numpy as np
import pytest
from PIL import Image

from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene

SYSTEM = """<SolarSystem TimeStep="120">
  <Body Name="Sun" Mass="1.98855E30" Radius="696342000" IsSun="yes" skin="Textures\\\\sun.png" normalSkin="Textures\\sun.png"/>
  <Body Name="Earth" Mass="5.97237E24" Radius="6371000" XPosition="149598023000" YVelocity="29780" skin="Textures\\Earth.PNG"
        transparentSkin="textures/clouds.png" shadowSkin=".\\Textures\\lights.png" specularSkin="Textures\\shine.png"
        normalSkin="Textures\\height.png" bumpParam="0.25" Tilt="23.44" RotationPeriod="0.99726968"/>
  <Body Name="Mars" Mass="6.4171E23" Radius="3389500" XPosition="227939200000" YVelocity="24077" skin="../mars.png"
        normalSkin="Textures\\missing.png" Tilt="25.19"/>
</SolarSystem>"""


@pytest.fixture
def folder(tmp_path):
    """A folder with the file and its pictures, and a picture outside of it."""
    inside = tmp_path / "system"
    (inside / "Textures").mkdir(parents=True)
    for name in ("sun", "earth", "clouds", "lights", "height", "shine"):
        Image.fromarray(np.zeros((8, 16), np.uint8)).save(inside / "Textures" / f"{name}.png")
    Image.fromarray(np.zeros((8, 16), np.uint8)).save(tmp_path / "mars.png")
    (inside / "SolarSystem.xml").write_text(SYSTEM, encoding="utf-8")
    return inside


def test_pictures_beside_the_file_go_into_the_scene_and_lines_tell_of_the_others(folder, capsys) -> None:
    assert main(["convert", str(folder / "SolarSystem.xml"), str(folder / "system.yaml")]) == 0
    bodies = load_scene(folder / "system.yaml").view.bodies
    sun, earth = bodies[0, 1], bodies[1, 1]
    assert (2, 1) not in bodies, "Mars has nothing left"
    textures = folder / "Textures"
    assert sun.texture.file == str(textures / "sun.png") and sun.light is not None and sun.normal is None
    assert earth.texture.file == str(textures / "earth.png"), "capitals need not agree"
    assert earth.clouds.file == str(textures / "clouds.png") and earth.night.file == str(textures / "lights.png")
    assert (earth.normal.file, earth.normal.strength) == (str(textures / "height.png"), 0.25)
    assert earth.spin.period == 0.99726968 * 86400
    tilt = math.radians(23.44)
    np.testing.assert_allclose(earth.spin.axis, [0.0, math.sin(tilt), math.cos(tilt)])
    told = capsys.readouterr().err
    assert "left out: skin of Mars, normalSkin of Mars (there is no such picture in its folder or below)" in told
    assert "left out: normalSkin of Sun (a body that shines has a texture only)" in told
    assert earth.specular.file == str(folder / "Textures" / "shine.png") and "specularSkin" not in told
    assert "left out: Tilt of Mars (the body has no RotationPeriod)" in told


def test_a_scene_names_pictures_below_its_own_folder_and_leaves_out_the_others(folder, tmp_path, capsys, monkeypatch) -> None:
    assert main(["convert", str(folder / "SolarSystem.xml"), str(tmp_path / "above.yaml"), "--quiet"]) == 0
    earth = load_scene(tmp_path / "above.yaml").view.bodies[1, 1]
    assert earth.texture.file == str(folder / "Textures" / "earth.png")
    capsys.readouterr()
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path / "other")
    assert main(["convert", "../system/SolarSystem.xml", "elsewhere.yaml", "--quiet"]) == 0
    earth = load_scene("elsewhere.yaml").view.bodies[1, 1]
    assert earth.texture is None and earth.spin is not None
    told = capsys.readouterr().err
    maps = ", ".join(f"{key} of Earth" for key in ("texture", "night", "clouds", "normal", "specular"))
    assert f"left out: texture of Sun, {maps} (its pictures are not" in told
