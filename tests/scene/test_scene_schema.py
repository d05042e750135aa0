"""The JSON Schema: up to date, valid, and in agreement with the checks on every bundled scene."""

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

from mpp_taichi import component
from mpp_taichi.scene.document import read_file
from mpp_taichi.scene.estimate import check_capacity, estimate
from mpp_taichi.scene.expectations import SUMMARY_QUANTITIES
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.model import definition_name
from mpp_taichi.scene.schema import SCHEMA_FILE, scene_schema, schema_text
from mpp_taichi.start.assemble import assemble

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml"))
BESIDE_OTHER_KEYS = {"contacts": "Contacts", "diagnostics": "Bounds"}
"""Kinds whose parameters stand beside keys that all components of the kind share, and how their definitions' names end."""
MODELINE = "# yaml-language-server: $schema=../mpp_taichi/scene.schema.json"


@pytest.fixture(scope="module")
def validator():
    schema = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_the_shipped_schema_is_that_of_the_model():
    shipped = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))  # the order of keys depends on pydantic's version
    assert shipped == json.loads(schema_text()), "renew it: python -m mpp_taichi.scene.schema"


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
@pytest.mark.sampled(3)
def test_a_bundled_scene_is_valid_commented_and_expects_something(path, validator):
    text = path.read_text(encoding="utf-8")
    assert text.startswith(MODELINE + "\n")
    assert "# Look at:" in text and "# Try:" in text
    tree = read_file(path, path.name, Faults()).plain()
    assert list(validator.iter_errors(tree)) == []
    assert tree["expect"] and tree["view"]["camera"]
    spec = load_scene(path)
    check_capacity(estimate(spec))
    snapshot = assemble(spec)
    counted = estimate(spec)
    assert (snapshot.particle_count, len(snapshot.springs)) == (counted.particle_count, counted.spring_count)


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_bundled_scene_is_the_same_for_a_plain_yaml_1_1_reader_but_for_floats(path):
    """Editors use other readers than ours: keys and lists must come out alike."""
    ours = read_file(path, path.name, Faults()).plain()
    theirs = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert _shape(ours) == _shape(theirs)


def _shape(value):
    if isinstance(value, dict):
        return {key: _shape(entry) for key, entry in value.items()}
    return [_shape(entry) for entry in value] if isinstance(value, list) else None


@pytest.mark.parametrize(
    "scene",
    [
        {},
        {"particles": []},
        {"particles": [{"body": {"position": [0, 0, 0]}}], "integrator": {"leapfrog": {"dt": 1}}},
        {"particles": [{"bodi": {}}], "integrator": {"leapfrog": {"dt": 1}}},
        {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "integrator": {"leapfrog": {"dt": 1}, "rk4": {"dt": 1}}},
        {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "integrator": {"leapfrog": {"dt": 0}}},
        {"particles": [{"body": {"mass": 1, "position": [0]}}], "integrator": {"leapfrog": {"dt": 1}}},
        {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "integrator": {"leapfrog": {"dt": 1}}, "rnu": 1},
        {"particles": ["body"], "integrator": {"leapfrog": {"dt": 1}}},
        {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "integrator": "leapfrog"},
    ],
)
def test_the_schema_refuses_what_the_model_refuses(scene, validator):
    assert list(validator.iter_errors(scene))


def test_the_schema_has_names_that_need_no_parameters(validator):
    scene = {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "forces": ["newtonian_gravity"]}
    scene |= {"integrator": "ias15", "run": {"duration": 1}}
    load_scene(scene)
    assert list(validator.iter_errors(scene)) == []


def test_every_component_and_parameter_is_described():
    definitions = scene_schema()["$defs"]
    for kind in component.KINDS:
        for name in component.names(kind):
            declared = component.declaration(kind, name)
            if declared.base == "BondForce":
                assert declared.class_name not in definitions
                continue
            described = definitions[definition_name(kind, declared) + BESIDE_OTHER_KEYS.get(kind, "")]
            parameters = {parameter.name for parameter in declared.parameters}
            keys = set(described["properties"])
            assert parameters <= keys if kind in BESIDE_OTHER_KEYS else parameters == keys
            assert (definitions["Expect"]["properties"][name] if kind == "diagnostics" else described)["description"]
            if kind == "quantities" and name not in SUMMARY_QUANTITIES:  # a key of `expect:` as well
                assert parameters <= set(definitions[declared.class_name + "Bounds"]["properties"])


def test_every_declared_default_passes_its_own_check():
    for kind in component.KINDS:
        for name in component.names(kind):
            for parameter in component.declaration(kind, name).parameters:
                if parameter.default is component.REQUIRED or parameter.default is None:
                    continue
                from mpp_taichi.scene.fields import Context
                from mpp_taichi.scene.parameters import field_of

                default = list(parameter.default) if isinstance(parameter.default, tuple) else parameter.default
                field_of(parameter).check(default, Context())


def test_the_scene_reference_is_fresh():
    """`python -m mpp_taichi.scene.write_reference_page` renews it."""
    from mpp_taichi.scene.write_reference_page import REFERENCE_FILE, reference_text

    assert REFERENCE_FILE.read_text(encoding="utf-8") == reference_text()
