"""A capture told to an agent: eight tools that only read, whose every statement says on which frames it rests.

`root` keeps a client of the Model Context Protocol inside one folder; `answers` bounds what it is told and marks what a
device or a file said; `tools` are the eight questions; `citations` resolves what an answer, or a text written from
answers, refers to; `server` binds the tools to the protocol (the package `mcp`, an extra).
"""

from __future__ import annotations

from ..errors import RtuscopeError


class AgentError(RtuscopeError):
    """What an agent asked for cannot be; the message, in one line, is this program's own words."""
