"""Blocks between processes: a wire format, and a JetStream stream that carries it."""
