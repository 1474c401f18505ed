"""Simulated clusters in, a verified model bundle out."""
