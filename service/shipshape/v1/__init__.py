"""Generated stubs of the gRPC contract; see README.md."""
