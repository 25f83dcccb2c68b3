"""The rules: a module a family. Nothing else lives in this folder, and nothing lists its modules."""
