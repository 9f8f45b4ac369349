"""Signal processing and alarm rules of padwatch: pure functions on plain values.

No module in this package imports an event loop, a clock, a file, a socket, a framework or a logger;
``make check`` verifies this.
"""
