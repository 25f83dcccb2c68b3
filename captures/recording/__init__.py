"""Recording for days: what was heard is on the disk within a second, and stays readable whatever happens.

`recorder` is what a program writes blocks to: it rotates files, keeps a ring of them and waits out a full disk.
`mcapfile` is one file with the bytes underneath it, or what is left of one that was cut, made whole; `ring` names and
limits, `notes` what happened besides the bytes.
"""
