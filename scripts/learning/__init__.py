"""Studies of learning, whose trainings are finished: data, tables and pictures."""
