"""The one source of the version."""

__version__ = "0.3.0"
