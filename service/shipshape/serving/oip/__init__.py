"""The Open Inference Protocol, version 2, in values of its own; both doors translate them to their wire."""
