"""Generated stubs of the Open Inference Protocol; see README.md."""
