"""The corpus's makers, a file each: `items(seed, size)` gives the items of a task."""
