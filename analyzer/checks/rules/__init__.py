"""The forms of rules, a family a file; nothing lists the files."""
