"""Numerics and rules of bearing watch: plain values in, plain values out.

Nothing in this package imports an event loop, a clock, a file, a socket, a framework or a logger;
``make check`` holds that line.
"""
