"""Bring your own fleet: a catalogue of meshes in, a verified bundle and its report out."""
