"""The sections of benches/results/accuracy.md, one per file; benches/accuracy.py is their command."""
