"""The score of a policy on the two standard laps, and statistics over laps and trainings."""
