"""Causes: one story for many findings. Exchanges, a ledger of them, suspects in bits, explaining away."""
