"""Suspects, a module a subject; `analyzer.causes.registry.suspects()` has them all."""
