"""The running program: command line, settings, wiring, runner, store, HTTP API and dashboard."""
