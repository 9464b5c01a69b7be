"""The sections of docs/accuracy.md, one per file; benches/accuracy.py is their command."""
