"""The one read-only model behind every interactive view: the same for files, live taps and replay.

A `Source` gives batches; `Bus.feed` takes them in, in one thread; views read rows by number from any other. It knows
nothing of widgets, and nothing of the protocol but what `analyzer.tables` and the declarations say.
"""
