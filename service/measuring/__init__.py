"""Sources to monitors to alarms to store; knows no HTTP."""
