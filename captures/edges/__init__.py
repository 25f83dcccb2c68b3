"""Edges of a logic analyser's channels to bytes: a UART in arrays.

`uart` decodes with known settings, `inference` finds them from the edges, `source` makes a capture of the channels that
carry characters. Times are in ns from whatever the file counts from.
"""
