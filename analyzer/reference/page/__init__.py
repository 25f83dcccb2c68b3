"""A page for the browser in which pastes are read as `rtuscope parse` reads them, by the same code, on Pyodide.

    python -m analyzer.reference.page OUT --pyodide node_modules/pyodide

`building` puts the folder together, `reading` is what the browser calls. npm's Pyodide has no numpy: `plainarrays`
stands in its place there, for the little that a paste holds.
"""
