"""`rtuscope mcp`: captures and lakes told to agents, over the Model Context Protocol."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..languages import counted
from .commands import DONE, FAILED
from .terminal import tell_user

if TYPE_CHECKING:
    from ..agents.root import AgentRoot

EXAMPLE = """\
rtuscope mcp --root captures
rtuscope mcp --root captures --verify answer.txt"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--root",
        metavar="FOLDER",
        required=True,
        help="folder of captures and lakes to serve; nothing outside it is read",
    )
    parser.add_argument(
        "--verify",
        metavar="FILE",
        help="do not serve; resolve each citation in this agent's text and list the frames; - is standard input",
    )


def run(arguments: argparse.Namespace) -> int:
    """Serve, or look an agent's words up."""
    from ..agents.root import AgentRoot

    root = AgentRoot(arguments.root)
    if arguments.verify is not None:
        return _verify(root, arguments.verify)
    from ..agents.server import serve

    serve(root)
    return DONE


def _verify(root: AgentRoot, name: str) -> int:
    from ..agents.citations import resolved_lines

    text = sys.stdin.read() if name == "-" else Path(name).read_text(encoding="utf-8", errors="replace")
    lines, broken = resolved_lines(root, text)
    for line in lines:
        print(line)
    if not lines:
        tell_user("no citation in this text")
    elif broken:
        tell_user(f"{counted(broken, 'citation refers', 'citations refer')} to nothing under the root")
    return DONE if lines and not broken else FAILED
