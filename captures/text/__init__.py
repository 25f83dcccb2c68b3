"""Bytes out of text that people and tools write. Pure Python: `rtuscope parse` starts with it and needs no arrays."""
