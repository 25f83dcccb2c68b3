"""The command line: a file a command, no analysis of its own.

A command parses its arguments, calls the library and prints. `app` holds what all share (exit status, one-line errors),
`commands` the table of what there is; only the chosen command's module is imported.
"""

from .app import main

__all__ = ["main"]
