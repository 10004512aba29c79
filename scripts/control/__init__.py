"""Controllers compared on the standard laps: a table for each question, with what was tried."""
