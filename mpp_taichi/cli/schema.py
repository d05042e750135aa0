"""Print the JSON Schema of scenes, for editors that complete and check YAML."""

import argparse

from mpp_taichi.cli._terminal import put


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare no options."""


def execute(arguments: argparse.Namespace) -> int:
    """Print it."""
    from mpp_taichi.scene.schema import schema_text

    put(schema_text().rstrip("\n"))
    return 0
