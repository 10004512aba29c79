"""The leaderboard: rows (controllers and agents), columns (tasks and axes), and the cells where they meet."""
