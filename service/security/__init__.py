"""Who may do what: roles, accounts, sessions, keys of machines."""
