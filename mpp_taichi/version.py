"""The version of the program, where every layer may read it; the package has it as `__version__`."""

__version__ = "0.1.0"
