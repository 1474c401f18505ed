"""Experiment 1 of the paper: ModelNet40 shapes with parts masked away, restored by image inpainting."""
