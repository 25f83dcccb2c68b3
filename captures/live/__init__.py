"""Bytes as they come from a tap: a serial device, a gateway's socket, two taps at once. Nothing here ever transmits.

`reader` runs in a process of its own, waits on the ports and stamps every read; `listening` starts it and hands on
what it says as blocks of chunks, `batching` and `wire` are what the two speak. `tap` opens one port, `readonly` does so
on POSIX, `gateway` one behind a network, `ports` lists what is there, `baud` finds a line's settings by listening.
`tapserver` lets others have what a tap hears, `tapviewer` listens to one elsewhere, `tapstream` is what both say
before.
"""
