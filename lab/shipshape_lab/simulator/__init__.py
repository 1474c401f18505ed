"""LiDAR clusters of vessels, with the truth about them."""
