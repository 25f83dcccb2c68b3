"""The ground: frames, transactions, values and findings as tables, what cuts and holds them."""
