"""Print the JSON Schema of scenes, for editors that complete and check YAML.

With `--path` it prints the file of the schema in this installation. An editor with the YAML language server uses the schema
where the first line of a scene is `# yaml-language-server: $schema=` and that path.
"""

import argparse

from mpp_taichi.cli._terminal import put


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the option."""
    parser.add_argument("--path", action="store_true", help="print the place of the schema's file")


def execute(arguments: argparse.Namespace) -> int:
    """Print the schema, or its place."""
    from mpp_taichi.scene.schema import SCHEMA_FILE, schema_text

    put(str(SCHEMA_FILE) if arguments.path else schema_text().rstrip("\n"))
    return 0
