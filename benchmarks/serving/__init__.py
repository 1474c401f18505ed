"""The same pipeline behind Shipshape's doors and behind the servers a user would otherwise pick, in one run."""
