"""Runs that other tools recorded: their files read in a process of little memory, never guessed."""
