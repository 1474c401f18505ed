"""The lab: simulates vessels, trains the networks of a bundle, and measures them."""
