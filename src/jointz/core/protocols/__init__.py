"""The model of a protocol and its checks."""
