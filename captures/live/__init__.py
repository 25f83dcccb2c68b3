"""Bytes as they come from a tap: a serial device, a gateway's socket, two taps at once. Nothing here ever transmits,
but `relay`, which passes on what others sent.

`reader` runs in a process of its own, waits on the ports and stamps every read; `listening` starts it and hands on
what it says as blocks of chunks, `batching` and `wire` are what the two speak. `tap` opens one port, `readonly` does so
on POSIX, `gateway` one behind a network, `ports` lists what is there, `baud` finds a line's settings by listening.
`child` is what such a process is to the one that starts it. `relay` passes bytes on between a client and its line, by
`relaylinks` and `relayends`, in a process that outlives whoever listens; `relaying` starts it. `tapserver` lets
others have what a tap hears, `tapviewer` listens to one elsewhere, `tapstream` is what both say before.
"""
