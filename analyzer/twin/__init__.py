"""Recorded units that answer again: `memory` is what one holds and says, `record` makes it of a capture, `serving`
gives it a port or a socket, `client` is the other side, which asks a real unit what was asked before.

The servers of pymodbus look a request up in a store of registers. They offer no place to wait for as long as the
recorded unit did, nor to say what it said of functions that they do not know, or of the same request in turn. So
requests are answered here, by the recorded bytes; only the envelope is made anew.
"""
