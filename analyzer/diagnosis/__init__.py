"""What is wrong with a bus, where, why probably, and what to do.

`rules` holds a declaration and a look for each finding, whose shape is that of `analyzer.tables.findings`; `judge` runs
them over rows as they come.
"""
