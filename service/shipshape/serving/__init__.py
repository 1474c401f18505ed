"""The doors and what they share: translate, delegate to the core, nothing else."""
