"""The HTTP API: a file of `routes` for each subject, access in `auth`, the server in `http`.

It reads live state, the store and recordings. Pages belong to `service.dashboard`, evidence of
alarms to `service.reports`.
"""
