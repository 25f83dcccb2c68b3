"""Buses of another hand than the field cases: byte by byte, with clients, units and taps of their own habits.

They share no code with `analyzer.simulation`, so that what is fitted there can be told here, and the other way round.
"""
