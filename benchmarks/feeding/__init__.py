"""The feeding law: what a capture tells does not hang on how it is fed.

    PYTHONPATH=. python -m benchmarks.feeding [--streams N] [--first N] [KIND ...]

Streams of every kind (`streams.KINDS`), a seed each, go through the analysis at once, read by read, byte by byte and
live (`ways`); frames, rows, their order, transactions and findings must be the same. A line a kind: streams, rows,
findings, breaches. Exit 1 where there is a breach, of which each is named by kind and seed.
"""
