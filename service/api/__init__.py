"""HTTP API: one module of `routes` for each subject, access control in `auth`, HTTP in `server`.

The API reads live state, the store and recordings. The web pages are in `service.dashboard`, the
evidence reports of alarms in `service.reports`.
"""
