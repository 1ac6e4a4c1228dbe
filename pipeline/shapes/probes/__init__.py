"""Probes, one per file."""
