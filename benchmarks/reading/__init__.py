"""The proof of the next reader of text: a lattice of readings, in which the sum of bits decides. Nothing of the product
imports it; it is scored beside the product's reader until it meets the gates that would let it take its place.

    python benchmarks/score_text.py styles --reader benchmarks.reading.reader:read_lines
    python benchmarks/score_text.py law --reader benchmarks.reading.reader:read_lines

On drawn styles that nothing was fitted on it reads 287 of 300 where the product reads 239. On known texts it still
loses some: copies of a screen, several turns in one line, rows of dumps with a star. Hostile rows cost it up to 160 us
a byte where 10 are meant, and it has no windows, so that streams cannot be read by it.
"""
