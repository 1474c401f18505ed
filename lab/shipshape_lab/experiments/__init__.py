"""Experiments: each is one command that leaves its numbers in a results folder; `report` writes them up."""
