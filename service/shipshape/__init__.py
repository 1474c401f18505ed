"""Recognise and restore vessels from sparse LiDAR clusters."""
