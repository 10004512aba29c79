"""The leaderboard: its entries (controllers and agents), its columns (tasks and axes), a cell for each pair."""
