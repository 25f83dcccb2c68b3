"""What is wrong with a bus, where, why probably, and what to do.

`model` holds the shape of a finding, `registry` the rules (one declaration and one look each, found in `rules`),
`diagnosis` runs them over rows as they come.
"""
