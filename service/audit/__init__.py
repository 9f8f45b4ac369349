"""The audit trail: who did what to what, before and after, chained so that changes show."""
