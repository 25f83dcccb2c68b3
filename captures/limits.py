"""Which times there are."""

from typing import Final

# ns either side of zero, the year 2115: neither the difference of two such times nor one moved by what a frame lasts
# (a month and more either way) leaves 64 bits
TIME_LIMIT: Final = (1 << 62) - (1 << 52)
