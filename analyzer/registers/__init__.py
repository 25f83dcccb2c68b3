"""What registers mean: readings as columns, hypotheses by description length, and what a map says."""
