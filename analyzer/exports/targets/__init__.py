"""The targets: a module each, named by the suffix that it writes. Nothing else lives in this folder."""
