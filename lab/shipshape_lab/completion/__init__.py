"""Comparison code: networks that complete point clouds, trained on the same clusters and poses as inpainting."""
