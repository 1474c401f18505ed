"""What a user would pick instead of Shipshape to name a vessel, trained on the same data with the same loop."""
